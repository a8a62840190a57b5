"""Objects that the beam is pushed against, and occluders that hide it from the camera.

An object is fixed in the world except for its drift. It yields along its own normal with the
stiffness in `pushes.stiffness_n_m`, and friction acts along the beam.
"""

from typing import Annotated, Literal

from pydantic import Field, model_validator

from vbaa_bench.scene.files import MeshName
from vbaa_bench.scene.paint import PaintedPart, TextureSpec
from vbaa_bench.scene.part import Below, Fraction, NonNegative, Part, Positive, Triple, Turn
from vbaa_bench.scene.weight import WeightSpec


class _ObjectSpec(PaintedPart):
    # Coulomb's coefficient; zero is the paper's extremely slippery object.
    friction: Annotated[float, Field(ge=0, le=1)] = 0.0
    # Motion of the object from one step of a push to the next, along the axes of the antenna at
    # first contact.
    drift_mm: Triple = (0.0, 0.0, 0.0)
    # On every side, along the axis that it faces most. On bare steel it is one of gloss.
    texture: TextureSpec | None = None

    @model_validator(mode="after")
    def _check_texture(self) -> "_ObjectSpec":
        if self.texture is not None and self.paint == "black":
            raise ValueError("texture is given and paint is black, allowed is any other paint")
        return self


class UprightSpec(_ObjectSpec):
    """Object with an upright front, from its bottom to its top."""

    top_mm: NonNegative = 0.4
    # By default it stands on the background.
    bottom_mm: Below | None = None


class BlockSpec(UprightSpec):
    """A square block; one of its upright edges touches the beam.

    A chamfer is on the edges of its top only. The touched edge keeps its place, but ends
    `chamfer_mm` below the top, and still above plane C.
    """

    kind: Literal["block"] = "block"
    side_mm: Positive = 12
    chamfer_mm: NonNegative = 0

    @model_validator(mode="after")
    def _check_chamfer(self) -> "BlockSpec":
        most = min(self.top_mm, self.side_mm / 2)
        if self.chamfer_mm and self.chamfer_mm >= most:
            raise ValueError(
                f"chamfer_mm is {self.chamfer_mm:g}, allowed is less than top_mm and than half of "
                f"side_mm, {most:g}"
            )
        return self


class CylinderSpec(UprightSpec):
    """An upright cylinder."""

    kind: Literal["cylinder"]
    radius_mm: Positive = 10


class PegSpec(UprightSpec):
    """A thin upright cylinder."""

    kind: Literal["peg"]
    radius_mm: Positive = 1


class SphereSpec(_ObjectSpec):
    """A sphere, touched at its equator; the beam slips off one that is too small."""

    kind: Literal["sphere"]
    radius_mm: Positive = 40


class KnifeEdgeSpec(_ObjectSpec):
    """A wedge; `pushes.normal_deg` tilts its normal nu out of plane C."""

    kind: Literal["knife_edge"]
    length_mm: Positive = 40
    depth_mm: Positive = 15
    half_angle_deg: Annotated[float, Field(gt=0, lt=80)] = 20


class WallSpec(UprightSpec):
    """A flat wall beside the beam, `gap_mm` from it and parallel to it at the angle of contact.

    The beam touches it from the tip inwards and lifts off at 3 gap / dtheta (Fig. 5).
    """

    kind: Literal["wall"]
    gap_mm: Positive
    length_mm: Positive = 300
    thickness_mm: Positive = 5


class PlungerSpec(UprightSpec):
    """A nose on a coil spring: the tiny spring-based force measure of Fig. 11."""

    kind: Literal["plunger"]
    top_mm: NonNegative = 1.5
    bottom_mm: Below | None = -4
    nose_radius_mm: Positive = 2
    free_length_mm: Positive = 25


class PadSpec(UprightSpec):
    """A soft pad, rounded towards the beam, which sinks into its face."""

    kind: Literal["pad"]
    top_mm: NonNegative = 0.3
    width_mm: Positive = 30
    thickness_mm: Positive = 15
    face_radius_mm: Positive = 40


class MeshSpec(_ObjectSpec):
    """Any closed mesh in an STL, OBJ or PLY file; its path is relative to the scene's folder.

    Its +y axis points to the beam and +z to the camera. It is turned by `turn_deg` about +z, moved
    along y until it touches a straight beam, and along x until it does so at the contact distance.
    """

    kind: Literal["mesh"]
    file: MeshName
    unit_mm: Positive = 1.0
    # Drawn for every push, this is an antenna that is carried about one object: see `carriage`.
    turn_deg: Turn = 0.0


class NothingSpec(Part):
    """No object at all: the beam in free space."""

    kind: Literal["none"]


ObjectSpec = Annotated[
    BlockSpec
    | CylinderSpec
    | PegSpec
    | SphereSpec
    | KnifeEdgeSpec
    | WallSpec
    | PlungerSpec
    | PadSpec
    | MeshSpec
    | WeightSpec
    | NothingSpec,
    Field(discriminator="kind"),
]


class SecondPegSpec(PaintedPart):
    """A peg on the other side of the beam, `gap_mm` from it at rest: a second contact."""

    distance_mm: Positive
    gap_mm: NonNegative = 1.0
    radius_mm: Positive = 1.0
    top_mm: NonNegative = 0.4
    bottom_mm: Below | None = None


class OcclusionSpec(PaintedPart):
    """Occlusions of the beam: every frame is repeated for every kind, place and availability.

    Availability is the paper's AR (eq. 32): the visible fraction of the beam's length.
    The hidden segment begins at the clamp, is about the contact or the middle, or ends at the
    tip. `removed` hides nothing in the image; the solver ignores that segment instead, as in the
    paper. The others are bodies between beam and camera.
    """

    kind: Annotated[tuple[Literal["removed", "sheet", "bars", "leaves"], ...], Field(min_length=1)]
    place: Annotated[
        tuple[Literal["base", "contact", "middle", "tip"], ...], Field(min_length=1)
    ] = ("contact",)
    availability: Annotated[
        tuple[Annotated[float, Field(gt=0, le=1)], ...], Field(min_length=1)
    ] = (0.6,)
    height_mm: Positive = 8
    reflectance: Fraction = 0.12
    # Number of bars, with gaps between them, or of leaves, at random places.
    count: Annotated[int, Field(ge=1, le=200)] = 6

    @model_validator(mode="after")
    def _check_bodies(self) -> "OcclusionSpec":
        bodies = set(self.kind) - {"removed"}
        if len(bodies) > 1:
            raise ValueError(
                f"kind is {list(self.kind)}, allowed is removed and one of sheet, bars, leaves"
            )
        return self

    @property
    def body(self) -> str | None:
        """Kind of the occluding body in frames whose cover is not `removed`, or None."""
        return next((kind for kind in self.kind if kind != "removed"), None)
