"""The camera, its optics, and the target that calibrates it."""

from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from solver.instrument.board import Board, Charuco, Chessboard, LineNetwork
from solver.instrument.distortion import COUNTS, one_to_one
from solver.instrument.units import MILLIMETRE
from vbaa_bench.scene.part import NonNegative, Part, Positive, Triple

Shift = Annotated[float, Field(ge=-100, le=100)]


class CameraSpec(Part):
    """Camera above plane C; by default with a roll and a look-at off the beam's axis.

    It is fixed to the antenna or to the world. In the world its pose is that in Sigma_a at motor
    angle zero, and no encoder reads the motor's angle (section III-A). A telecentric lens has a
    magnification in place of a focal length.
    """

    mount: Literal["antenna", "world"] = Field(
        default="antenna",
        description="Whether the camera turns with the antenna, or stands in the world, where "
        "no encoder reads the motor's angle.",
    )
    projection: Literal["perspective", "telecentric"] = Field(
        default="perspective",
        description="A perspective camera has a focal length, a telecentric one a magnification.",
    )
    magnification_px_per_mm: Positive | None = Field(
        default=None, description="Magnification of a telecentric camera."
    )
    width_px: Annotated[int, Field(ge=32, le=8192)] = Field(
        default=512, description="Width of the image."
    )
    height_px: Annotated[int, Field(ge=32, le=8192)] = Field(
        default=512, description="Height of the image."
    )
    focal_length_px: Positive = Field(
        default=700, description="Focal length of a perspective camera."
    )
    principal_point_offset_px: tuple[float, float] = Field(
        default=(0.0, 0.0),
        description="Principal point relative to the middle of the image, to the right and down.",
    )
    distortion: tuple[float, ...] = Field(
        default=(), description="OpenCV's coefficients of lens distortion: none, 5, or 8."
    )
    position_mm: Triple = Field(default=(120.0, 18.0, 360.0), description="Position of the camera.")
    look_at_mm: Triple = Field(
        default=(120.6, 20.0, 0.0),
        description="Point in the middle of the view, which is in focus by default.",
    )
    roll_deg: Annotated[float, Field(ge=-360, le=360)] = Field(
        default=0.6, description="Turn of the camera about its line of sight."
    )
    knock_px: tuple[Shift, Shift] = Field(
        default=(0.0, 0.0),
        description="Shift of all frames against the images of the board and of the beam at "
        "rest, as of a camera that was knocked after these.",
    )
    tip_in_view: bool = Field(
        default=True,
        description="Whether the whole beam must be in view; a short one may leave the image.",
    )

    @model_validator(mode="after")
    def _check_magnification(self) -> "CameraSpec":
        if self.is_telecentric != (self.magnification_px_per_mm is not None):
            raise ValueError("magnification_px_per_mm must be given for a telecentric camera only")
        return self

    @model_validator(mode="after")
    def _check_distortion(self) -> "CameraSpec":
        count = len(self.distortion)
        if count not in COUNTS:
            raise ValueError(f"distortion holds {count} numbers, allowed are 0, 5 or 8")
        if count and self.is_telecentric:
            raise ValueError("distortion is for a perspective camera, a telecentric one has none")
        if not one_to_one(self._border_points(), self.distortion):
            raise ValueError(
                f"distortion {list(self.distortion)} maps different points to the same pixel, "
                "allowed is a one-to-one mapping"
            )
        return self

    @property
    def is_telecentric(self) -> bool:
        """Whether it has a magnification in place of a focal length."""
        return self.projection == "telecentric"

    def _border_points(self) -> np.ndarray:
        """Compute points (n, 2) slightly outside the image's border, over the focal length."""
        half = 0.55 * np.array([self.width_px, self.height_px])
        fractions = np.linspace(-1, 1, 33)[:, None]
        sides = [np.hstack([fractions, np.full_like(fractions, end)]) for end in (-1.0, 1.0)]
        border = np.vstack([*sides, *(side[:, ::-1] for side in sides)]) * half
        return np.asarray((border - self.principal_point_offset_px) / self.focal_length_px)


class OpticsSpec(Part):
    """Point spread, depth of field and vignetting."""

    point_spread_px: Annotated[float, Field(ge=0, le=20)] = Field(
        default=0.0, description="Sigma of a Gaussian point spread."
    )
    aperture_mm: NonNegative = Field(
        default=0.0, description="Diameter of the entrance pupil; with 0 everything is in focus."
    )
    focus_distance_mm: Positive | None = Field(
        default=None, description="Depth in focus; by default that of the look-at point."
    )
    vignetting_pct: Annotated[float, Field(ge=0, le=90)] = Field(
        default=0.0, description="Darkening of the image's corners relative to its middle."
    )


class CalibrationSpec(Part):
    """Calibration target with points square_mm apart; view 0 is in plane C, the others are tilted.

    The points are a chessboard's inner corners, those of a ChArUco board, whose markers are from
    `dictionary`, or the crossings of a network of dark lines, line_width_mm wide (section VI-A).
    """

    target: Literal["chessboard", "charuco", "lines"] = Field(
        default="chessboard",
        description="A chessboard's inner corners, those of a ChArUco board, or the crossings "
        "of a network of dark lines.",
    )
    columns: Annotated[int, Field(ge=4, le=60)] = Field(
        default=12, description="Number of inner corners or crossings along x."
    )
    rows: Annotated[int, Field(ge=3, le=60)] = Field(
        default=9, description="Number of inner corners or crossings along y."
    )
    square_mm: Positive = Field(
        default=18, description="Distance of neighbouring corners or crossings."
    )
    dictionary: Literal["4x4_50", "4x4_100", "4x4_250", "4x4_1000"] = Field(
        default="4x4_250", description="Markers of a ChArUco board, by OpenCV's name."
    )
    line_width_mm: Positive | None = Field(
        default=None, description="Width of the lines, for the target lines only."
    )
    center_mm: tuple[float, float] = Field(
        default=(120.0, 18.0), description="Middle of the target in plane C."
    )
    views: Annotated[int, Field(ge=1, le=100)] = Field(
        default=10,
        description="Number of images; view 0 is in plane C, the others are tilted. Only a "
        "telecentric camera needs less than three.",
    )
    tilt_deg: Annotated[float, Field(gt=0, le=45)] = Field(
        default=25, description="Largest tilt of the other views."
    )

    @model_validator(mode="after")
    def _check_target(self) -> "CalibrationSpec":
        if (self.target == "lines") != (self.line_width_mm is not None):
            raise ValueError("line_width_mm must be given for the target lines only")
        if self.target == "chessboard" and self.columns % 2 == self.rows % 2:
            raise ValueError(
                f"columns {self.columns} and rows {self.rows}: one must be even and one odd, "
                "or the board looks the same after a half-turn"
            )
        _ = self.board  # raises ValueError if it is impossible
        return self

    @property
    def board(self) -> Board:
        """The target."""
        size = (self.columns, self.rows, self.square_mm * MILLIMETRE)
        if self.target == "charuco":
            return Charuco(*size, self.dictionary)
        if self.line_width_mm is not None:
            return LineNetwork(*size, self.line_width_mm * MILLIMETRE)
        return Chessboard(*size)
