"""The background under the beam: its keys, and what each of its patterns decides.

A pattern is a kind of ground that is registered under its name in `GROUNDS`. All have the keys of
`BackgroundSpec` in common.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, ClassVar, Final, Literal, NamedTuple

import numpy as np
from pydantic import Field, model_validator

from solver.instrument.arrays import Floats
from solver.instrument.transforms import turn_about_z
from solver.instrument.units import DEGREE, MILLIMETRE
from vbaa_bench.geometry.mesh import Mesh
from vbaa_bench.geometry.sheets import edge_side, edged_sheet, sheet, squares
from vbaa_bench.geometry.textures import Texture, gradient_texture, image_texture, random_texture
from vbaa_bench.scene.families import Names
from vbaa_bench.scene.files import ImageFiles, ImageName
from vbaa_bench.scene.part import Coordinate, Fraction, Part, Positive, Turn

# Side of a sheet so large that the camera never sees its border, over the beam's length.
_SIDE: Final = 20
# Both tones of squares are distinct if a square has at least two pixels.
RESOLVED_PX: Final = 2.0
# Most squares along a side: each takes about 1 kB in the renderer, so that all take 1 GB at most.
MAX_SQUARES: Final = 1000


class GroundSetting(NamedTuple):
    """What the shape of a ground refers to: the beam, and the camera's view. Lengths are [m].

    A square of side `view` about the place below the beam's middle fills the image at every motor
    angle. At that place, a pixel is `pixel` large.
    """

    beam_length: float
    view: float
    pixel: float

    def middle(self, height: float) -> Floats:
        """Return the place (3,) below the beam's middle, at a height."""
        return np.array([self.beam_length / 2, 0.0, height])

    @property
    def endless(self) -> float:
        """Side of a sheet whose border the camera never sees."""
        return _SIDE * self.beam_length


class Sheet(NamedTuple):
    """One surface of a ground: its name, its mesh [m] in the ground's frame, its reflectance."""

    name: str
    mesh: Mesh
    reflectance: float


class Mistake(NamedTuple):
    """What is wrong with a key of the background."""

    key: str
    sentence: str


class EdgeSpec(Part):
    """The ground's straight edge, `distance_mm` from the beam's middle towards `azimuth_deg`.

    Behind it is a floor, `drop_mm` lower. Azimuth is measured from +x to +y, in plane C.
    """

    distance_mm: Positive = Field(
        default=60, description="Distance of the edge from the beam's middle."
    )
    azimuth_deg: Annotated[float, Field(ge=-360, le=360)] = Field(
        default=90, description="Direction in which the edge lies, from +x to +y in plane C."
    )
    drop_mm: Positive = Field(default=300, description="Height of the ground above the floor.")
    thickness_mm: Positive = Field(default=25, description="Thickness of the ground.")
    side_reflectance: Fraction = Field(default=0.2, description="Reflectance of the ground's side.")
    floor_reflectance: Fraction = Field(default=0.12, description="Reflectance of the floor.")

    def line(self, middle: Floats) -> Floats:
        """Return the unit normal and the distance (3,) [m] from the origin of the edge.

        `middle` (2,) [m] is the place below the beam's middle.
        """
        azimuth = self.azimuth_deg * DEGREE
        normal = np.array([np.cos(azimuth), np.sin(azimuth)])
        return np.array([*normal, self.distance_mm * MILLIMETRE + float(normal @ middle)])

    def top(self, middle: Floats, side: float) -> Mesh:
        """Mesh a sheet of the given side [m] about `middle` (3,) [m], up to the edge."""
        azimuth, distance = self.azimuth_deg * DEGREE, self.distance_mm * MILLIMETRE
        return edged_sheet(middle, side, azimuth, distance)

    def below(self, middle: Floats, side: float) -> Iterator[Sheet]:
        """Yield the side of such a sheet, and the floor."""
        azimuth, distance = self.azimuth_deg * DEGREE, self.distance_mm * MILLIMETRE
        thickness = min(self.thickness_mm, self.drop_mm) * MILLIMETRE
        upright = edge_side(middle, side, azimuth, distance, thickness)
        yield Sheet("table_side", upright, self.side_reflectance)
        floor = middle - [0.0, 0.0, self.drop_mm * MILLIMETRE]
        yield Sheet("floor", sheet(floor, side, 1), self.floor_reflectance)


@dataclass(frozen=True)
class GroundKind:
    """A kind of ground: an even sheet, and the base of those with a pattern."""

    spec: "BackgroundSpec"

    # Whether all of it looks the same.
    is_even: ClassVar[bool] = False
    # Whether it shows `spec.image_file`, which others must not have.
    needs_image: ClassVar[bool] = False
    # Whether it may end at an edge.
    may_have_edge: ClassVar[bool] = True
    # Whether a pattern of several surfaces in one plane slides in it where the ground turns.
    slides: ClassVar[bool] = False

    @property
    def mean_reflectance(self) -> float:
        """Mean reflectance."""
        return self.spec.reflectance

    def mistake(self, _setting: GroundSetting) -> Mistake | None:
        """Describe what is impossible in this setting; None if nothing is."""
        return None

    def top(self, setting: GroundSetting) -> Iterator[Sheet]:
        """Yield the surfaces of the ground itself, made anew."""
        mesh = self._sheet(setting.middle(self.spec.height), setting)
        yield Sheet("background", mesh, self.spec.reflectance)

    def texture(
        self, _setting: GroundSetting, _files: ImageFiles, _random: np.random.Generator
    ) -> Texture | None:
        """Create the texture of its only surface; None without one. Raises SceneFileError."""
        return None

    def _sheet(self, middle: Floats, setting: GroundSetting) -> Mesh:
        """Mesh a sheet about `middle` (3,) [m], up to the edge if there is one."""
        edge, side = self.spec.edge, setting.endless
        return sheet(middle, side, 1) if edge is None else edge.top(middle, side)

    def places(self, setting: GroundSetting) -> Floats:
        """Return the corners (n, 2) [m] of the sheet, about the place below the beam's middle."""
        return np.asarray(self._sheet(np.zeros(3), setting).vertices)[:, :2]


class _Plain(GroundKind):
    is_even = True


class Squares(GroundKind):
    """Squares of two reflectances."""

    may_have_edge = False
    slides = True

    @property
    def mean_reflectance(self) -> float:
        """Mean of both."""
        return (self.spec.reflectance + self.spec.square_reflectance) / 2

    def finest(self, setting: GroundSetting) -> float:
        """Compute the smallest square [m] that the camera resolves and the renderer can hold."""
        return max(RESOLVED_PX * setting.pixel, setting.view / MAX_SQUARES)

    def mistake(self, setting: GroundSetting) -> Mistake | None:
        """Describe squares that are too small."""
        finest, stated = self.finest(setting) / MILLIMETRE, self.spec.square_mm
        if stated >= finest:
            return None
        return Mistake(
            "square_mm",
            f"is {stated:g}, allowed is >= {finest:.3g}: smaller squares are below "
            f"{RESOLVED_PX:g} px, or more than {MAX_SQUARES} along a side of the ground in view; "
            "pattern plain looks the same",
        )

    def top(self, setting: GroundSetting) -> Iterator[Sheet]:
        """Yield the bright and the dark squares, edge to edge, as many as are in view."""
        spec, turn = self.spec, self.spec.square_turn_deg * DEGREE
        to_ground = turn_about_z(turn)
        axes = to_ground[:2, :2]
        # The pattern repeats after two squares along its own axes.
        offset = axes @ np.fmod(axes.T @ spec.square_offset_mm, 2 * spec.square_mm) * MILLIMETRE
        to_ground[:3, 3] = setting.middle(spec.height) + np.append(offset, 0.0)
        side = setting.view + 2 * float(np.abs(offset).max())
        turned_side = side * (abs(math.cos(turn)) + abs(math.sin(turn)))
        light, dark = squares(turned_side, spec.square_mm * MILLIMETRE)
        for name, mesh, reflectance in (
            ("background", light, spec.reflectance),
            ("background_squares", dark, spec.square_reflectance),
        ):
            mesh.apply_transform(to_ground)
            yield Sheet(name, mesh, reflectance)


class _Graded(GroundKind):
    @property
    def mean_reflectance(self) -> float:
        return (self.spec.reflectance + self.spec.far_reflectance) / 2

    def texture(
        self, setting: GroundSetting, _files: ImageFiles, _random: np.random.Generator
    ) -> Texture:
        spec, places = self.spec, self.places(setting)
        azimuth, length = spec.gradient_deg * DEGREE, spec.gradient_mm * MILLIMETRE
        return gradient_texture(places, spec.reflectance, spec.far_reflectance, azimuth, length)


class _Textured(GroundKind):
    def texture(
        self, setting: GroundSetting, _files: ImageFiles, random: np.random.Generator
    ) -> Texture:
        spec, places = self.spec, self.places(setting)
        grain = spec.correlation_mm * MILLIMETRE
        lengths, repeat = (grain * spec.correlation_ratio, grain), 2 * setting.beam_length
        return random_texture(places, spec.reflectance, spec.contrast, lengths, repeat, random)


class _Image(GroundKind):
    needs_image = True

    def texture(
        self, setting: GroundSetting, files: ImageFiles, _random: np.random.Generator
    ) -> Texture:
        spec, places = self.spec, self.places(setting)
        assert spec.image_file is not None
        image, width = files.image(spec.image_file), spec.image_width_mm * MILLIMETRE
        return image_texture(places, image, spec.reflectance, width)


GROUNDS: Final = Names[GroundKind]()
GROUNDS.register(plain=_Plain, squares=Squares, graded=_Graded, textured=_Textured, image=_Image)
# Names of all surfaces of grounds.
GROUND: Final = {"background", "background_squares", "table_side", "floor"}


class BackgroundSpec(Part):
    """Matt sheet below plane C, wider than the camera's view.

    It is plain; has darker squares; is graded, from `reflectance` on one side of the view to
    `far_reflectance` on the other; is textured at random, like cork, wood or foam; or shows an
    image, a PNG, JPEG or OpenEXR file in the scene's folder or below, repeated and
    `image_width_mm` wide. An image's mean is `reflectance`.
    """

    distance_mm: Positive = Field(default=30, description="Distance below plane C.")
    reflectance: Fraction = Field(
        default=0.05,
        description="Reflectance, of squares the brighter one, of textures and images the mean.",
    )
    pattern: Annotated[str, GROUNDS] = Field(
        default="plain",
        description="How it looks: an even gray, squares, a gradient, a random texture, or an "
        "image.",
    )
    square_mm: Positive = Field(default=15, description="Side of the squares.")
    square_reflectance: Fraction = Field(
        default=0.02, description="Reflectance of the darker squares."
    )
    square_offset_mm: tuple[Coordinate, Coordinate] = Field(
        default=(0.0, 0.0),
        description="Place, relative to below the beam's middle, where four squares meet; "
        "with no offset an edge between squares lies along the beam at rest.",
    )
    square_turn_deg: Turn = Field(
        default=0.0, description="Direction of the squares, from +x to +y."
    )
    far_reflectance: Fraction = Field(
        default=0.30, description="Reflectance at the far end of a gradient."
    )
    gradient_deg: Annotated[float, Field(ge=-360, le=360)] = Field(
        default=90, description="Direction of the change to `far_reflectance`, from +x to +y."
    )
    gradient_mm: Positive = Field(default=200, description="Length of the change.")
    contrast: Annotated[float, Field(gt=0, le=1)] = Field(
        default=0.4, description="Standard deviation of a texture's reflectance over its mean."
    )
    correlation_mm: Positive = Field(
        default=2.0, description="Distance at which a texture's correlation is 1/e, along y."
    )
    correlation_ratio: Annotated[float, Field(ge=1, le=100)] = Field(
        default=1.0, description="Distance at which it is 1/e along x, over that along y."
    )
    image_file: ImageName | None = Field(
        default=None, description="File of the image, in the scene's folder or below."
    )
    image_width_mm: Positive = Field(
        default=200, description="Width of the image, which is repeated."
    )
    edge: EdgeSpec | None = Field(
        default=None,
        description="Edge of the ground, if the camera is to see one; not with squares.",
    )
    fixed_to: Literal["antenna", "world"] = Field(
        default="antenna",
        description="Fixed to the antenna's base plate, or to the world, where it turns past "
        "the camera.",
    )

    @model_validator(mode="after")
    def _check_image(self) -> "BackgroundSpec":
        if self.kind.needs_image != (self.image_file is not None):
            names = " or ".join(name for name, kind in GROUNDS.kinds.items() if kind.needs_image)
            raise ValueError(f"image_file must be given for the pattern {names} only")
        return self

    @model_validator(mode="after")
    def _check_edge(self) -> "BackgroundSpec":
        if self.edge is not None and not self.kind.may_have_edge:
            raise ValueError(
                f"edge is given and pattern is {self.pattern}, allowed is any other pattern"
            )
        return self

    @property
    def kind(self) -> GroundKind:
        """What the pattern decides."""
        return GROUNDS[self.pattern](self)

    @property
    def height(self) -> float:
        """Height [m] above plane C; it is negative."""
        return -self.distance_mm * MILLIMETRE

    @property
    def is_endless(self) -> bool:
        """Whether it looks the same at every motor angle."""
        return self.kind.is_even and self.edge is None

    def below_edge(self, setting: GroundSetting) -> Iterator[Sheet]:
        """Yield what is beyond the edge, made anew; nothing without an edge."""
        if self.edge is not None:
            yield from self.edge.below(setting.middle(self.height), setting.endless)
