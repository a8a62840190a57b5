"""Beam of a scene, and the stated accuracy of its rig."""

import math
from dataclasses import dataclass
from typing import Annotated, Final, Literal

from pydantic import Field, model_validator

from solver.instrument.beam import circular_rigidity
from solver.instrument.rig import MAX_SHIFT_PX
from vbaa_bench.geometry.tip import Tip
from vbaa_bench.scene.paint import GrimeSpec, Paint, PaintedPart
from vbaa_bench.scene.part import Fraction, Part, Positive, Tilt, Tolerance


@dataclass(frozen=True)
class Section:
    """Shape of a beam's section, whose width is its thickness times an aspect ratio.

    `fill` is its area over that of the rectangle about it.
    """

    rod_shape: Literal["ellipse", "rectangle"]
    fill: float

    @property
    def is_flat(self) -> bool:
        """Whether it is that of a strip, with edges and faces."""
        return self.rod_shape == "rectangle"

    def rigidity(self, youngs_modulus: float, thickness: float, aspect_ratio: float) -> float:
        """Compute the rigidity [N m^2] of bending along the thickness [m]."""
        if self.is_flat:
            return youngs_modulus * aspect_ratio * thickness**4 / 12
        return circular_rigidity(youngs_modulus, thickness) * aspect_ratio


_ROUND: Final = Section("ellipse", math.pi / 4)
SECTIONS: Final = {
    "circular": _ROUND,
    "elliptic": _ROUND,
    "strip": Section("rectangle", 1.0),
}


class BeamSpec(PaintedPart):
    """Beam and its paint; by default that of section VI: straight, round and uniform."""

    paint: Paint = Field(default="gloss", description="Paint of the beam.")
    length_mm: Positive = Field(default=240, description="Free length, from the clamp to the tip.")
    diameter_mm: Positive = Field(
        default=0.8, description="Diameter at the clamp; of a strip, its thickness."
    )
    youngs_modulus_gpa: Positive = Field(default=200, description="Young's modulus.")
    yield_stress_mpa: Positive = Field(
        default=1500,
        description="Stress above which a push is refused, as the beam would stay bent.",
    )
    allow_above_yield: bool = Field(
        default=False, description="Whether the beam may be stressed above its yield stress."
    )
    reflectance: Fraction = Field(default=0.85, description="Reflectance of matt and gloss paint.")
    section: Literal["circular", "elliptic", "strip"] = Field(
        default="circular",
        description="Shape of the section: an elliptic one, or a flat strip, is "
        "`aspect_ratio` times as wide as it is thick.",
    )
    aspect_ratio: Annotated[float, Field(ge=0.1, le=100)] = Field(
        default=1.0,
        description="Width of the section over its thickness; 1 for a circular section only.",
    )
    section_angle_deg: Tilt = Field(
        default=0.0, description="Turn of the section's thickness from y towards z."
    )
    tip_ratio: Annotated[float, Field(ge=0.02, le=3)] = Field(
        default=1.0,
        description="Diameter of a tapered beam at the tip over that at the clamp; 0.02 is a "
        "rat's whisker.",
    )
    bow_mm: Annotated[float, Field(ge=-1e3, le=1e3)] = Field(
        default=0.0,
        description="Distance of the unloaded beam's middle from its chord, towards +y.",
    )
    density_kg_m3: Positive = Field(
        default=7930, description="Density, which matters where there is gravity."
    )
    extensible: bool = Field(
        default=False, description="Whether the beam stretches under its axial force."
    )
    clamp_softness: Annotated[float, Field(ge=0, le=1)] = Field(
        default=0.0,
        description="Rotation of the clamp over its bending moment, in units of L / EI.",
    )
    tip: Tip = Field(
        default="flat",
        description="Shape of a round beam's tip, over its last diameter; length and "
        "mechanics stay those of a flat tip.",
    )
    grime: GrimeSpec | None = Field(
        default=None,
        description="Smudges, dust and uneven gloss on the beam; clean without this section.",
    )
    centreline_segments: Annotated[int, Field(ge=16, le=10_000)] = Field(
        default=480, description="Number of segments of the centreline in the truth."
    )

    @model_validator(mode="after")
    def _check_aspect_ratio(self) -> "BeamSpec":
        if (self.section == "circular") != (self.aspect_ratio == 1):
            raise ValueError(
                f"section {self.section} with aspect_ratio {self.aspect_ratio:g}: allowed is 1 for "
                "a circular section, any other for an elliptic one or a strip"
            )
        if self.section_shape.is_flat and self.tip != "flat":
            raise ValueError(f"tip is {self.tip}, allowed is flat for a strip")
        if self.section_shape.is_flat and self.aspect_ratio < 2:
            raise ValueError(f"aspect_ratio is {self.aspect_ratio:g}, allowed is >= 2 for a strip")
        return self

    @property
    def section_shape(self) -> Section:
        """Shape of the section."""
        return SECTIONS[self.section]


class ToleranceSpec(Part):
    """Stated accuracy of the rig: one sigma, written to rig.json.

    The encoder's readings always have errors of its sigma, and are multiples of its step.
    """

    beam_length_mm: Tolerance = Field(default=0.1, description="Sigma of the beam's length.")
    tip_mm: Tolerance = Field(
        default=0.0,
        description="Sigma of the apparent end of the bent beam against that at rest; "
        "rendered ends are cut square.",
    )
    flexural_rigidity_pct: Annotated[float, Field(ge=0, le=20)] = Field(
        default=1.0, description="Sigma of the flexural rigidity EI."
    )
    base_mm: Tolerance = Field(
        default=0.01, description="Sigma of the place of the beam's root, in each direction."
    )
    clamp_offset_mm: Tolerance = Field(
        default=0.0,
        description="Sigma of the clamp's position relative to the motor's axis; the truth is "
        "the scene's clamp_offset_mm.",
    )
    grip_mm: Tolerance = Field(
        default=0.0,
        description="Sigma of how much deeper the clamp grips the beam, whose free length is "
        "shorter by as much.",
    )
    board_mm: Tolerance = Field(
        default=0.01, description="Sigma of the board's place, in each direction."
    )
    board_deg: Annotated[float, Field(ge=0, le=10)] = Field(
        default=0.01, description="Sigma of the board's direction, about each axis."
    )
    encoder_deg: Annotated[float, Field(ge=0, le=10)] = Field(
        default=0.01, description="Sigma of the encoder's readings, which always have these errors."
    )
    encoder_step_deg: Annotated[float, Field(ge=0, le=10)] = Field(
        default=0.0, description="Step of the encoder's readings."
    )
    camera_shift_px: Annotated[float, Field(ge=0, le=MAX_SHIFT_PX)] = Field(
        default=0.0,
        description="Sigma of the shift of the image since the rest images, in each direction.",
    )
    gravity_deg: Annotated[float, Field(ge=0, le=10)] = Field(
        default=0.0,
        description="Sigma of the direction of gravity in plane C, which a hung weight needs.",
    )
    tip_ratio_pct: Annotated[float, Field(ge=0, le=80)] = Field(
        default=0.0, description="Sigma of the width at the tip over that at the clamp, less one."
    )
    aspect_ratio_pct: Annotated[float, Field(ge=0, le=50)] = Field(
        default=0.0, description="Sigma of the section's second axis over its first, less one."
    )
    friction: Annotated[float, Field(ge=0, le=2)] = Field(
        default=0.0, description="Sigma of the object's coefficient of friction."
    )
    clamp_softness: Annotated[float, Field(ge=0, le=1)] = Field(
        default=0.0,
        description="Sigma of the clamp's rotation over its moment, in units of L / EI.",
    )
    bow_mm: Tolerance | None = Field(
        default=None,
        description="Sigma of the tip's distance from the clamp's tangent at rest; by default "
        "the rest images alone determine it.",
    )
    rigid_objects: bool = Field(
        default=False,
        description="Whether the rig states that no object yields, and that the motor does "
        "not turn back while it pushes.",
    )
    true_rig: Literal["nominal", "drawn"] = Field(
        default="nominal",
        description="Whether the truth is nominal, or drawn with these sigmas about the "
        "nominal values.",
    )
