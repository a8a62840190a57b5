"""The background under the beam, and its edge."""

from typing import Annotated, Literal

from pydantic import Field, model_validator

from vbaa_bench.scene.files import ImageName
from vbaa_bench.scene.part import Coordinate, Fraction, Part, Positive, Turn


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
    pattern: Literal["plain", "squares", "graded", "textured", "image"] = Field(
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
        if (self.pattern == "image") != (self.image_file is not None):
            raise ValueError("image_file must be given for the pattern image only")
        return self

    @model_validator(mode="after")
    def _check_edge(self) -> "BackgroundSpec":
        if self.edge is not None and self.pattern == "squares":
            raise ValueError("edge is given and pattern is squares, allowed is any other pattern")
        return self
