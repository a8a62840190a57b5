"""The laboratory about the beam: camera and calibration, lamp and ground, motor and sensors."""

from typing import Annotated, Literal

from pydantic import Field, model_validator

from vbaa_bench.spec.part import Below, Part, Positive, Share, Triple

Layer = Literal["radiance", "beam_mask", "arc_length", "depth", "object_index"]


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


class LightSpec(Part):
    """A square lamp facing plane C, about the camera's axis and behind the camera."""

    side_mm: Positive = 700
    height_mm: Positive = 420


class BackgroundSpec(Part):
    """A matt sheet below plane C, wider than the camera sees; plain, or with darker squares."""

    distance_mm: Positive = 30
    reflectance: Share = 0.05
    pattern: Literal["plain", "squares"] = "plain"
    square_mm: Positive = 15
    square_reflectance: Share = 0.02
    # Fixed to the antenna's base plate, or lying in the world, where it turns past the camera.
    lies_in: Literal["antenna", "world"] = "antenna"


class HubSpec(Part):
    """The motor's hub that clamps the beam: an upright cylinder about the motor's axis."""

    radius_mm: Positive = 3
    top_mm: Positive = 2
    # Without a bottom it stands on the background.
    bottom_mm: Below | None = None
    reflectance: Share = 0.10


class SensorSpec(Part):
    """The image sensor, exposed so that the resting beam peaks at `beam_peak_pct` of full scale."""

    bits: Literal[8] = 8
    full_well_e: Annotated[float, Field(ge=10, le=1e7)] = 10_000
    read_noise_e: Annotated[float, Field(ge=0, le=1e6)] = 10
    beam_peak_pct: Annotated[float, Field(gt=0, le=100)] = 70
    rest_images: Annotated[int, Field(ge=1, le=1000)] = 4


class ForceSensorSpec(Part):
    """Force and moment at the clamp, as the conventional antenna of section VII measures them."""

    force_sigma_n: Annotated[float, Field(gt=0, le=1e3)] = 1e-3
    moment_sigma_n_mm: Annotated[float, Field(gt=0, le=1e6)] = 0.1


class MomentSensorSpec(Part):
    """The moment m_y about Sigma_a's y axis at the clamp (section V-C)."""

    sigma_n_mm: Annotated[float, Field(gt=0, le=1e6)] = 0.1


class RenderSpec(Part):
    """Samples per pixel: square numbers, so that every pixel is stratified in both directions."""

    samples_near_beam: Literal[16, 64, 256, 1024] = 256
    samples_elsewhere: Literal[4, 16, 64, 256] = 16
    near_beam_px: Annotated[int, Field(ge=1, le=64)] = 5
