"""Lamps, and the background under the beam."""

from typing import Annotated, Literal

from pydantic import Field, model_validator

from vbaa_bench.scene.clutter import EdgeSpec
from vbaa_bench.scene.files import FileName
from vbaa_bench.scene.part import Coordinate, Fraction, Part, Positive, Triple, Turn

Sides = tuple[Positive, Positive]


class LightSpec(Part):
    """Square lamp that faces plane C, about the camera's axis and behind the camera."""

    side_mm: Positive = 700
    height_mm: Positive = 420


class _LampSpec(Part):
    """One of several lamps, fixed to the same frame as the camera and aimed at its look-at."""

    # Of a sheet at the aim that faces the lamp. Only ratios matter: the beam sets the exposure.
    irradiance: Positive = 1.0


class AreaSpec(_LampSpec):
    """Rectangular lamp anywhere; its first side is as parallel to the beam as possible."""

    kind: Literal["area"]
    position_mm: Triple = (120.0, -250.0, 420.0)
    aim_mm: Triple | None = None
    size_mm: Sides = (300, 200)


class SideSpec(_LampSpec):
    """Rectangular lamp low at the side; azimuth is measured from +x to +y, in plane C."""

    kind: Literal["side"]
    azimuth_deg: Annotated[float, Field(ge=-360, le=360)] = -90
    elevation_deg: Annotated[float, Field(gt=0, lt=90)] = 15
    distance_mm: Positive = 400
    size_mm: Sides = (400, 100)


class RingSpec(_LampSpec):
    """Ring lamp about the lens, perpendicular to the camera's axis, with two radii."""

    kind: Literal["ring"]
    inner_radius_mm: Positive = 35
    outer_radius_mm: Positive = 60

    @model_validator(mode="after")
    def _check_radii(self) -> "RingSpec":
        if self.inner_radius_mm >= self.outer_radius_mm:
            raise ValueError(
                f"inner_radius_mm is {self.inner_radius_mm:g}, allowed is less than "
                f"outer_radius_mm, {self.outer_radius_mm:g}"
            )
        return self


class BackSpec(_LampSpec):
    """Luminous panel that is `height_above_background_mm` above the background and shines upwards.

    `irradiance` is that of plane C from below.
    """

    kind: Literal["back"]
    size_mm: Sides = (400, 400)
    height_above_background_mm: Positive = 0.5


class StripeSpec(_LampSpec):
    """Projector of a bright stripe along the beam: the paper's artificial light.

    Length and width are those at the aim, across the light; the edges fade over `edge_width_mm`.
    """

    kind: Literal["stripe"]
    position_mm: Triple = (120.0, -200.0, 350.0)
    aim_mm: Triple | None = None
    length_mm: Positive = 280
    width_mm: Positive = 90
    edge_width_mm: Positive = 4

    @model_validator(mode="after")
    def _check_edge_width(self) -> "StripeSpec":
        if self.edge_width_mm < self.width_mm / 200:
            raise ValueError(
                f"edge_width_mm is {self.edge_width_mm:g}, allowed is >= 1/200 of width_mm, "
                f"{self.width_mm:g}"
            )
        return self


class SpotSpec(_LampSpec):
    """Small lamp that lights a cone and casts hard shadows."""

    kind: Literal["spot"]
    position_mm: Triple = (0.0, -200.0, 350.0)
    aim_mm: Triple | None = None
    cone_angle_deg: Annotated[float, Field(ge=1, le=170)] = 60


class EnvironmentSpec(_LampSpec):
    """Light from all around: a laboratory with a window and lamps at its ceiling, or an image.

    The image is an OpenEXR file beside the scene that maps longitude and latitude, its top row
    towards +z, its columns from +x through +y around. `irradiance` is that of plane C.
    """

    kind: Literal["environment"]
    file: FileName | None = None
    rotation_deg: Annotated[float, Field(ge=-360, le=360)] = 0


LampSpec = Annotated[
    AreaSpec | SideSpec | RingSpec | BackSpec | StripeSpec | SpotSpec | EnvironmentSpec,
    Field(discriminator="kind"),
]


class FlickerSpec(Part):
    """Power of all lamps on alternating current: 1 + depth cos(2 pi 2 mains_hz t + phase).

    The phase is drawn for every image, also for those of the board and of the beam at rest. An
    image integrates the power over its exposure; a rolling shutter shows it as bands.
    """

    mains_hz: Annotated[float, Field(ge=1, le=1e5)] = 50.0
    depth_pct: Annotated[float, Field(ge=0, le=100)]


class AmbientSpec(Part):
    """Even light from all directions, in addition to `light` or `lights`.

    `irradiance` is that of plane C where the camera looks: over that by the soft lamp of `light`,
    or in the unit of the irradiances in `lights`, of which each has 1 by default.
    """

    irradiance: Annotated[float, Field(ge=1e-6, le=100)] = 0.3


class BackgroundSpec(Part):
    """Matt sheet below plane C, wider than the camera's view.

    It is plain; has darker squares; is graded, from `reflectance` on one side of the view to
    `far_reflectance` on the other; is textured at random, like cork, wood or foam; or shows an
    image, a PNG, JPEG or OpenEXR file in the scene's folder or below, repeated and
    `image_width_mm` wide. An image's mean is `reflectance`.
    """

    distance_mm: Positive = 30
    reflectance: Fraction = 0.05
    pattern: Literal["plain", "squares", "graded", "textured", "image"] = "plain"
    square_mm: Positive = 15
    square_reflectance: Fraction = 0.02
    # Place, relative to below the beam's middle, where four squares meet, and their direction. With
    # no offset an edge between squares lies along the beam at rest.
    square_offset_mm: tuple[Coordinate, Coordinate] = (0.0, 0.0)
    square_turn_deg: Turn = 0.0
    far_reflectance: Fraction = 0.30
    # Direction, from +x to +y, of the change to `far_reflectance`, and the length of the change.
    gradient_deg: Annotated[float, Field(ge=-360, le=360)] = 90
    gradient_mm: Positive = 200
    # Standard deviation over mean.
    contrast: Annotated[float, Field(gt=0, le=1)] = 0.4
    # Distance at which the correlation is 1/e, along y; along x, `correlation_ratio` times that.
    correlation_mm: Positive = 2.0
    correlation_ratio: Annotated[float, Field(ge=1, le=100)] = 1.0
    image_file: FileName | None = None
    image_width_mm: Positive = 200
    # Edge of the ground, if the camera is to see one; not with squares.
    edge: EdgeSpec | None = None
    # Fixed to the antenna's base plate, or to the world, where it turns past the camera.
    fixed_to: Literal["antenna", "world"] = "antenna"

    @model_validator(mode="after")
    def _check_image(self) -> "BackgroundSpec":
        if (self.pattern == "image") != (self.image_file is not None):
            raise ValueError("image_file must be given for the pattern image only")
        return self

    @model_validator(mode="after")
    def _check_edge(self) -> "BackgroundSpec":
        if self.edge is not None and self.pattern == "squares":
            raise ValueError("edge is given and pattern is squares, allowed is any other pattern")
        return self
