"""The motor's hub, and the sensors at the clamp."""

from typing import Annotated

from pydantic import Field

from vbaa_bench.scene.paint import PaintedPart
from vbaa_bench.scene.part import Below, Fraction, Part, Positive


class HubSpec(PaintedPart):
    """The motor's hub that clamps the beam: an upright cylinder about the motor's axis."""

    radius_mm: Positive = 3
    top_mm: Positive = 2
    # By default it stands on the background.
    bottom_mm: Below | None = None
    reflectance: Fraction = 0.10


class ForceSensorSpec(Part):
    """Sensor of force and moment at the clamp, as in the conventional antenna of section VII."""

    force_sigma_n: Annotated[float, Field(gt=0, le=1e3)] = 1e-3
    moment_sigma_n_mm: Annotated[float, Field(gt=0, le=1e6)] = 0.1


class MomentSensorSpec(Part):
    """Sensor of the moment m_y about Sigma_a's y axis at the clamp (section V-C)."""

    sigma_n_mm: Annotated[float, Field(gt=0, le=1e6)] = 0.1
