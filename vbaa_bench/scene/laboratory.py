"""The motor's hub, the clamp, and the sensors at the clamp."""

from typing import Annotated

from pydantic import Field, model_validator

from vbaa_bench.scene.paint import Paint, PaintedPart
from vbaa_bench.scene.part import Below, Fraction, Part, Positive, Tolerance


class HubSpec(PaintedPart):
    """The motor's hub that clamps the beam: an upright cylinder about the motor's axis."""

    radius_mm: Positive = Field(default=3, description="Radius of the cylinder.")
    top_mm: Positive = Field(default=2, description="Height of its top above plane C.")
    bottom_mm: Below | None = Field(
        default=None, description="Height of its bottom; by default it stands on the background."
    )
    reflectance: Fraction = Field(default=0.10, description="Reflectance of matt and gloss paint.")


class ClampSpec(PaintedPart):
    """A jaw that holds the beam, with a screw on top, a flange under it, and a cable.

    `jaw_mm` is its length behind the beam's root, its width and its height. It ends where the beam
    begins, at x = 0, so that it hides less of the beam than the hub alone: without an offset of the
    clamp, the hub ends under the jaw. The flange is about the motor's axis, and the cable leads
    from the jaw to the ground. All move with the antenna. The paint is that of jaw and flange.
    """

    jaw_mm: tuple[Positive, Positive, Positive] = Field(
        default=(14, 9, 7),
        description="The jaw's length behind the beam's root, its width and its height.",
    )
    screw_radius_mm: Positive = Field(
        default=2, description="Radius of the screw on top of the jaw."
    )
    screw_paint: Paint = Field(default="bare", description="Paint of the screw.")
    flange_radius_mm: Positive = Field(
        default=8, description="Radius of the flange under the jaw, about the motor's axis."
    )
    flange_thickness_mm: Positive = Field(default=3, description="Thickness of the flange.")
    cable_radius_mm: Positive = Field(
        default=1, description="Radius of the cable that leads from the jaw to the ground."
    )
    cable_reflectance: Fraction = Field(default=0.05, description="Reflectance of the cable.")
    paint: Paint = Field(default="gloss", description="Paint of jaw and flange.")
    reflectance: Fraction = Field(default=0.30, description="Reflectance of matt and gloss paint.")

    @model_validator(mode="after")
    def _check_screw(self) -> "ClampSpec":
        most = 0.45 * min(self.jaw_mm[:2])
        if self.screw_radius_mm > most:
            raise ValueError(
                f"screw_radius_mm is {self.screw_radius_mm:g}, allowed is up to 0.45 of the jaw's "
                f"length and width, {most:g}"
            )
        return self


class CarriageSpec(Part):
    """A carriage that brings the antenna to the object, push after push, and reads its own pose.

    The object is fixed on a table, whose frame is that of the object: of a mesh, that of its file.
    The readings have normal errors with these sigmas, new ones in every push.
    """

    position_sigma_mm: Tolerance = Field(
        default=0.005, description="Sigma of the read position, in each direction."
    )
    turn_sigma_deg: Annotated[float, Field(ge=0, le=10)] = Field(
        default=0.002, description="Sigma of the read direction."
    )


class ForceSensorSpec(Part):
    """Sensor of force and moment at the clamp, as in the conventional antenna of section VII."""

    force_sigma_n: Annotated[float, Field(gt=0, le=1e3)] = Field(
        default=1e-3, description="Sigma of each component of the force."
    )
    moment_sigma_n_mm: Annotated[float, Field(gt=0, le=1e6)] = Field(
        default=0.1, description="Sigma of each component of the moment."
    )


class MomentSensorSpec(Part):
    """Sensor of the moment m_y about Sigma_a's y axis at the clamp (section V-C)."""

    sigma_n_mm: Annotated[float, Field(gt=0, le=1e6)] = Field(
        default=0.1, description="Sigma of the moment."
    )
