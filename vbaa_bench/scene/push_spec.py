"""Pushes of a scene."""

from typing import Annotated, Final, Literal

from pydantic import Field, model_validator

from vbaa_bench.scene.part import ONSET, Onset, Part, Positive, Tilt

# As many as sampling.count allows. Chosen: two days of rendering, a terabyte with all layers.
MAX_FRAMES: Final = 1_000_000

Angle = Annotated[float, Field(gt=-60, lt=60)]


class PushSpec(Part):
    """Grid of pushes: contact distances x normals x stiffnesses x repeats, step after step.

    Contact distance is that of the first contact, on the beam at rest; deflection is the tip's
    displacement across the beam, over L. The deflections, or pushing angles, are the steps of one
    push in their order; a step whose angle is not positive is before contact.
    """

    contact_distance_mm: Annotated[tuple[Positive, ...], Field(min_length=1)] | None = Field(
        default=None,
        description="Contact distances, along the beam at rest; not needed for a wall or "
        "without an object.",
    )
    deflection_pct: tuple[Annotated[float, Field(gt=0, lt=60)], ...] | None = Field(
        default=None,
        description="Steps of a push, as the tip's displacement across the beam over the length.",
    )
    pushing_angle_deg: tuple[Angle, ...] | None = Field(
        default=None,
        description="Steps of a push, as the motor's rotation since first contact; before "
        "contact, it is not positive.",
    )
    normal_deg: Annotated[tuple[Tilt, ...], Field(min_length=1)] = Field(
        default=(0.0,), description="Tilts nu of the touched edge's normal out of plane C."
    )
    stiffness_n_m: Annotated[tuple[Positive | Literal["rigid"], ...], Field(min_length=1)] = Field(
        default=("rigid",), description="Stiffnesses of the object along its normal, or rigid."
    )
    repeats: Annotated[int, Field(ge=1, le=MAX_FRAMES)] = Field(
        default=1, description="Number of pushes with the same values."
    )
    motor_angle_at_contact_deg: Onset = Field(
        default=ONSET,
        description="Range from which the motor's angle at first contact is drawn for every "
        "push; equal ends fix it. Of a push with one step, it is the angle of that step, to a "
        "few tenths of a degree: otherwise the encoder would reveal the pushing angle, which "
        "depends on the contact.",
    )

    @model_validator(mode="after")
    def _check_onset(self) -> "PushSpec":
        limits = self.motor_angle_at_contact_deg
        if limits[0] > limits[1]:
            raise ValueError(
                f"motor_angle_at_contact_deg is {list(limits)}, allowed is a range from low to high"
            )
        return self

    @model_validator(mode="after")
    def _check_steps(self) -> "PushSpec":
        if (self.deflection_pct is None) == (self.pushing_angle_deg is None):
            raise ValueError("exactly one of deflection_pct and pushing_angle_deg must be given")
        if not (self.deflection_pct or self.pushing_angle_deg):
            raise ValueError("the list of deflections or pushing angles is empty")
        return self
