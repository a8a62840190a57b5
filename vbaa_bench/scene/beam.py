"""Beam of a scene, and the stated accuracy of its rig."""

from typing import Annotated, Literal

from pydantic import Field, model_validator

from solver.instrument.rig import MAX_SHIFT_PX
from vbaa_bench.scene.paint import GrimeSpec, Paint, PaintedPart
from vbaa_bench.scene.part import Fraction, Part, Positive, Tilt, Tolerance


class BeamSpec(PaintedPart):
    """Beam and its paint; by default that of section VI: straight, round and uniform."""

    paint: Paint = "gloss"
    length_mm: Positive = 240
    # For a strip this is its thickness.
    diameter_mm: Positive = 0.8
    youngs_modulus_gpa: Positive = 200
    yield_stress_mpa: Positive = 1500
    allow_above_yield: bool = False
    reflectance: Fraction = 0.85
    # An elliptic section, or a flat strip, is `aspect_ratio` times as wide as it is thick; its
    # thickness is turned from y towards z by `section_angle_deg`.
    section: Literal["circular", "elliptic", "strip"] = "circular"
    aspect_ratio: Annotated[float, Field(ge=0.1, le=100)] = 1.0
    section_angle_deg: Tilt = 0.0
    # A tapered beam's diameter at the tip over that at the clamp; 0.02 is a rat's whisker.
    tip_ratio: Annotated[float, Field(ge=0.02, le=3)] = 1.0
    # Bow of the unloaded beam: its middle's distance from its chord, towards +y.
    bow_mm: Annotated[float, Field(ge=-1e3, le=1e3)] = 0.0
    density_kg_m3: Positive = 7930
    # Whether it stretches under its axial force.
    extensible: bool = False
    # Rotation of the clamp over its bending moment, in units of L / EI.
    clamp_softness: Annotated[float, Field(ge=0, le=1)] = 0.0
    # Shape of a round beam's tip. Its length and its mechanics stay those of a flat tip: the shape
    # differs over the last diameter only, a share diameter / length of the beam.
    tip: Literal["flat", "round", "cut", "burr"] = "flat"
    grime: GrimeSpec | None = None
    # Number of segments of the centreline.
    centreline_segments: Annotated[int, Field(ge=16, le=10_000)] = 480

    @model_validator(mode="after")
    def _check_aspect_ratio(self) -> "BeamSpec":
        if (self.section == "circular") != (self.aspect_ratio == 1):
            raise ValueError(
                f"section {self.section} with aspect_ratio {self.aspect_ratio:g}: allowed is 1 for "
                "a circular section, any other for an elliptic one or a strip"
            )
        if self.section == "strip" and self.tip != "flat":
            raise ValueError(f"tip is {self.tip}, allowed is flat for a strip")
        if self.section == "strip" and self.aspect_ratio < 2:
            raise ValueError(f"aspect_ratio is {self.aspect_ratio:g}, allowed is >= 2 for a strip")
        return self


class ToleranceSpec(Part):
    """Stated accuracy of the rig: one sigma, written to rig.json.

    The encoder's readings always have errors of its sigma, and are multiples of its step.
    """

    beam_length_mm: Tolerance = 0.1
    # Of the apparent end of the bent beam against that at rest: rendered ends are cut square.
    tip_mm: Tolerance = 0.0
    flexural_rigidity_pct: Annotated[float, Field(ge=0, le=20)] = 1.0
    base_mm: Tolerance = 0.01
    # Position of the clamp relative to the motor's axis; the truth is the scene's clamp_offset_mm.
    clamp_offset_mm: Tolerance = 0.0
    # How much deeper the clamp grips the beam, whose free length is shorter by as much.
    grip_mm: Tolerance = 0.0
    board_mm: Tolerance = 0.01
    board_deg: Annotated[float, Field(ge=0, le=10)] = 0.01
    encoder_deg: Annotated[float, Field(ge=0, le=10)] = 0.01
    encoder_step_deg: Annotated[float, Field(ge=0, le=10)] = 0.0
    # Shift of the image since the rest images, in each direction.
    camera_shift_px: Annotated[float, Field(ge=0, le=MAX_SHIFT_PX)] = 0.0
    # Direction of gravity in plane C, which a hung weight needs.
    gravity_deg: Annotated[float, Field(ge=0, le=10)] = 0.0
    # Stated sigmas of what a uniform, frictionless beam on a rigid clamp does not have: width of
    # the tip over that at the clamp, less one; the section's second axis over its first, less one;
    # coefficient of friction; the clamp's rotation over its moment, in units of L / EI.
    tip_ratio_pct: Annotated[float, Field(ge=0, le=80)] = 0.0
    aspect_ratio_pct: Annotated[float, Field(ge=0, le=50)] = 0.0
    friction: Annotated[float, Field(ge=0, le=2)] = 0.0
    clamp_softness: Annotated[float, Field(ge=0, le=1)] = 0.0
    # Stated sigma of the tip's distance from the clamp's tangent at rest; by default the rest
    # images alone determine it.
    bow_mm: Tolerance | None = None
    # Stated: no object yields, and the motor does not turn back while it pushes.
    rigid_objects: bool = False
    # true_rig: nominal puts the truth on the nominal values; drawn displaces it by these sigmas.
    true_rig: Literal["nominal", "drawn"] = "nominal"
