"""Flicker of the lamps, and the background under the beam."""

from typing import Annotated, Literal

from pydantic import Field, model_validator

from vbaa_bench.scene.clutter import EdgeSpec
from vbaa_bench.scene.files import ImageName
from vbaa_bench.scene.part import Coordinate, Fraction, Part, Positive, Turn


class FlickerSpec(Part):
    """Power of all lamps on alternating current: 1 + depth cos(2 pi 2 mains_hz t + phase).

    The phase is drawn for every image, also for those of the board and of the beam at rest. An
    image integrates the power over its exposure; a rolling shutter shows it as bands.
    """

    mains_hz: Annotated[float, Field(ge=1, le=1e5)] = 50.0
    depth_pct: Annotated[float, Field(ge=0, le=100)]


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
    image_file: ImageName | None = None
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
