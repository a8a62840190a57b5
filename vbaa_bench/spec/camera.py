"""The camera, its optics, and the target that calibrates it."""

from typing import Annotated, Literal

from pydantic import Field, model_validator

from vbaa_bench.spec.part import Part, Positive, Triple


class CameraSpec(Part):
    """Above plane C; roll and a look-at off the beam's axis as in any mount.

    It rides on the antenna, or stands in the world: then its place is that in Sigma_a at first
    contact, and no encoder tells the motor's angle (section III-A). A telecentric lens has a
    magnification in place of a focal length.
    """

    mount: Literal["antenna", "world"] = "antenna"
    projection: Literal["perspective", "telecentric"] = "perspective"
    magnification_px_per_mm: Positive | None = None
    width_px: Annotated[int, Field(ge=32, le=8192)] = 512
    height_px: Annotated[int, Field(ge=32, le=8192)] = 512
    focal_length_px: Positive = 700
    principal_point_offset_px: tuple[float, float] = (0.0, 0.0)
    position_mm: Triple = (120.0, 18.0, 360.0)
    look_at_mm: Triple = (120.6, 20.0, 0.0)
    # A board is read the right way up within this range.
    roll_deg: Annotated[float, Field(ge=-45, le=45)] = 0.6
    # Whether the whole beam must be in view; a short one may leave the image.
    sees_tip: bool = True

    @model_validator(mode="after")
    def _one_scale(self) -> "CameraSpec":
        if (self.projection == "telecentric") != (self.magnification_px_per_mm is not None):
            raise ValueError("magnification_px_per_mm is for a telecentric camera, which needs it")
        return self


class CalibrationSpec(Part):
    """A chessboard of inner corners; view 0 lies in plane C, the others tilt it."""

    columns: Annotated[int, Field(ge=4, le=60)] = 12
    rows: Annotated[int, Field(ge=3, le=60)] = 9
    square_mm: Positive = 18
    center_mm: tuple[float, float] = (120.0, 18.0)
    # A telecentric camera needs view 0 alone, any other at least three.
    views: Annotated[int, Field(ge=1, le=100)] = 10
    tilt_deg: Annotated[float, Field(gt=0, le=45)] = 25

    @model_validator(mode="after")
    def _no_half_turn(self) -> "CalibrationSpec":
        if self.columns % 2 == self.rows % 2:
            raise ValueError(
                f"columns {self.columns} and rows {self.rows}: one must be even and one odd, "
                "or the board looks the same after a half-turn"
            )
        return self
