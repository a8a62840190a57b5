"""The scene: every number of a simulated experiment, as its YAML file states it.

Units are in the names. Defaults describe the paper's rig (section VI).
"""

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

# Generous, but finite: a nanometre to a kilometre in mm; nothing overflows later.
Positive = Annotated[float, Field(ge=1e-6, le=1e6)]
Share = Annotated[float, Field(ge=0, le=1)]
Coordinate = Annotated[float, Field(ge=-1e6, le=1e6)]
Triple = tuple[Coordinate, Coordinate, Coordinate]
Tolerance = Annotated[float, Field(ge=0, le=1e3)]


class Part(BaseModel):
    """A section of a scene: immutable, no unknown keys, no inf or NaN."""

    model_config = ConfigDict(
        frozen=True, extra="forbid", allow_inf_nan=False, strict=True, validate_default=True
    )


class BeamSpec(Part):
    """The beam and its paint; section VI's by default."""

    length_mm: Positive = 240
    diameter_mm: Positive = 0.8
    youngs_modulus_gpa: Positive = 200
    yield_stress_mpa: Positive = 1500
    allow_above_yield: bool = False
    reflectance: Share = 0.85
    facets: Annotated[int, Field(ge=8, le=256, multiple_of=4)] = 48
    # The mesh is cut into this many pieces along the beam: the chord of half a millimetre leaves
    # the arc by less than a micrometre at the sharpest bend that spring steel bears.
    pieces: Annotated[int, Field(ge=16, le=10_000)] = 480


class ToleranceSpec(Part):
    """What the laboratory believes of its rig's accuracy: one sigma, written to rig.json.

    The encoder's readings always err by its sigma.
    """

    beam_length_mm: Tolerance = 0.1
    flexural_rigidity_pct: Annotated[float, Field(ge=0, le=20)] = 1.0
    base_mm: Tolerance = 0.01
    board_mm: Tolerance = 0.01
    board_deg: Annotated[float, Field(ge=0, le=10)] = 0.01
    encoder_deg: Annotated[float, Field(ge=0, le=10)] = 0.01
    # true_rig: nominal puts the truth on the nominal values; drawn displaces it by these sigmas.
    true_rig: Literal["nominal", "drawn"] = "nominal"


class CameraSpec(Part):
    """Fixed in Sigma_a, above plane C; roll and a look-at off the beam's axis as in any mount."""

    width_px: Annotated[int, Field(ge=32, le=8192)] = 512
    height_px: Annotated[int, Field(ge=32, le=8192)] = 512
    focal_length_px: Positive = 700
    principal_point_offset_px: tuple[float, float] = (0.0, 0.0)
    position_mm: Triple = (120.0, 18.0, 360.0)
    look_at_mm: Triple = (120.6, 20.0, 0.0)
    # A board is read the right way up within this range.
    roll_deg: Annotated[float, Field(ge=-45, le=45)] = 0.6


class CalibrationSpec(Part):
    """A chessboard of inner corners; view 0 lies in plane C, the others tilt it."""

    columns: Annotated[int, Field(ge=4, le=60)] = 12
    rows: Annotated[int, Field(ge=3, le=60)] = 9
    square_mm: Positive = 18
    center_mm: tuple[float, float] = (120.0, 18.0)
    views: Annotated[int, Field(ge=3, le=100)] = 10
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
    """A matt sheet below plane C, wider than the camera sees."""

    distance_mm: Positive = 30
    reflectance: Share = 0.05


class ObjectSpec(Part):
    """A square block whose upright edge touches the beam; it stands fixed in the world."""

    kind: Literal["block"] = "block"
    side_mm: Positive = 12
    top_mm: Annotated[float, Field(ge=0)] = 0.4
    bottom_mm: Annotated[float, Field(lt=0)] = -15
    reflectance: Share = 0.16


class HubSpec(Part):
    """The motor's hub that clamps the beam: an upright cylinder about the motor's axis."""

    radius_mm: Positive = 3
    top_mm: Positive = 2
    bottom_mm: Annotated[float, Field(lt=0)] = -20
    reflectance: Share = 0.10


class SensorSpec(Part):
    """The image sensor, exposed so that the resting beam peaks at `beam_peak_pct` of full scale."""

    bits: Literal[8] = 8
    full_well_e: Annotated[float, Field(ge=10, le=1e7)] = 10_000
    read_noise_e: Annotated[float, Field(ge=0, le=1e6)] = 10
    beam_peak_pct: Annotated[float, Field(gt=0, le=100)] = 70
    rest_images: Annotated[int, Field(ge=1, le=1000)] = 4


class RenderSpec(Part):
    """Samples per pixel: square numbers, so that every pixel is stratified in both directions."""

    samples_near_beam: Literal[16, 64, 256, 1024] = 256
    samples_elsewhere: Literal[4, 16, 64, 256] = 16
    near_beam_px: Annotated[int, Field(ge=1, le=64)] = 5


Layer = Literal["radiance", "beam_mask", "arc_length", "depth", "object_index"]


class PushSpec(Part):
    """The grid of pushes: contact distances x deflections (or pushing angles) x repeats.

    Contact distance is where the beam at rest first touches; deflection is y_tip / L in Sigma_d.
    """

    contact_distance_mm: Annotated[tuple[Positive, ...], Field(min_length=1)]
    deflection_pct: tuple[Annotated[float, Field(gt=0, lt=60)], ...] | None = None
    pushing_angle_deg: tuple[Annotated[float, Field(gt=0, lt=60)], ...] | None = None
    repeats: Annotated[int, Field(ge=1)] = 1
    motor_angle_at_contact_deg: Annotated[float, Field(ge=-360, le=360)] = 0.0

    @model_validator(mode="after")
    def _one_push_axis(self) -> "PushSpec":
        if (self.deflection_pct is None) == (self.pushing_angle_deg is None):
            raise ValueError("exactly one of deflection_pct and pushing_angle_deg must be given")
        if not (self.deflection_pct or self.pushing_angle_deg):
            raise ValueError("the list of deflections or pushing angles is empty")
        return self


class Scene(Part):
    """One experiment. With its seed it determines the truth to the last byte."""

    title: Annotated[str, Field(min_length=1)]
    seed: Annotated[int, Field(ge=0, lt=2**63)]
    pushes: PushSpec
    beam: BeamSpec = BeamSpec()
    tolerances: ToleranceSpec = ToleranceSpec()
    camera: CameraSpec = CameraSpec()
    calibration: CalibrationSpec = CalibrationSpec()
    light: LightSpec = LightSpec()
    background: BackgroundSpec = BackgroundSpec()
    object: ObjectSpec = ObjectSpec()
    hub: HubSpec = HubSpec()
    sensor: SensorSpec = SensorSpec()
    render: RenderSpec = RenderSpec()
    layers: tuple[Layer, ...] = ("radiance", "beam_mask", "arc_length", "depth", "object_index")
    frames_per_shard: Annotated[int, Field(ge=1, le=10_000)] = 16

    @model_validator(mode="after")
    def _lamp_behind_camera(self) -> "Scene":
        camera, lamp = self.camera.position_mm[2], self.light.height_mm
        if not 0 < camera < lamp:
            raise ValueError(
                f"camera.position_mm has height {camera:g} and light.height_mm is {lamp:g}; "
                "allowed is 0 < camera < light, so that the lamp shines from behind the camera"
            )
        return self
