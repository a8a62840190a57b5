"""The motor's hub, and the sensors at the clamp."""

from typing import Annotated

from pydantic import Field

from vbaa_bench.spec.paint import PaintedPart
from vbaa_bench.spec.part import Below, Part, Positive, Share


class HubSpec(PaintedPart):
    """The motor's hub that clamps the beam: an upright cylinder about the motor's axis."""

    radius_mm: Positive = 3
    top_mm: Positive = 2
    # Without a bottom it stands on the background.
    bottom_mm: Below | None = None
    reflectance: Share = 0.10


class ForceSensorSpec(Part):
    """Force and moment at the clamp, as the conventional antenna of section VII measures them."""

    force_sigma_n: Annotated[float, Field(gt=0, le=1e3)] = 1e-3
    moment_sigma_n_mm: Annotated[float, Field(gt=0, le=1e6)] = 0.1


class MomentSensorSpec(Part):
    """The moment m_y about Sigma_a's y axis at the clamp (section V-C)."""

    sigma_n_mm: Annotated[float, Field(gt=0, le=1e6)] = 0.1
