"""The scene: every number of a simulated experiment, as in its YAML file.

Units are in the names. Defaults describe the paper's rig (section VI).
"""

from collections.abc import Mapping
from typing import Annotated, Any, Final, Literal

from pydantic import Field, model_validator

from vbaa_bench.scene.beam import BeamSpec, ToleranceSpec
from vbaa_bench.scene.camera import CalibrationSpec, CameraSpec
from vbaa_bench.scene.clutter import ClutterSpec
from vbaa_bench.scene.image_sensor import SensorSpec
from vbaa_bench.scene.laboratory import (
    CarriageSpec,
    ClampSpec,
    ForceSensorSpec,
    HubSpec,
    MomentSensorSpec,
)
from vbaa_bench.scene.lighting import BackgroundSpec, FlickerSpec
from vbaa_bench.scene.lights.ambient import AmbientSpec
from vbaa_bench.scene.lights.light import AnyLight, LightSetting
from vbaa_bench.scene.lights.soft import LightSpec
from vbaa_bench.scene.objects.block import BlockSpec
from vbaa_bench.scene.objects.object import AnyObject
from vbaa_bench.scene.occlusion import OcclusionSpec
from vbaa_bench.scene.optics import OpticsSpec
from vbaa_bench.scene.part import (
    Onset,
    Part,
    Triple,
)
from vbaa_bench.scene.presets import Look, with_preset
from vbaa_bench.scene.push_spec import PushSpec
from vbaa_bench.scene.random_keys import RandomKey
from vbaa_bench.scene.rendering import Layer, RenderSpec
from vbaa_bench.scene.sampling import SamplingSpec, SplitSpec
from vbaa_bench.scene.scene_checks import CHECKS
from vbaa_bench.scene.second_peg import SecondPegSpec
from vbaa_bench.scene.unit_values import Method
from vbaa_bench.scene.wires import WiresSpec

# Chosen: each takes seconds and a megabyte.
MAX_RIGS: Final = 1_000_000


class Scene(Part):
    """One experiment. Together with its seed it determines every byte of the truth."""

    title: Annotated[str, Field(min_length=1)]
    seed: Annotated[int, Field(ge=0, lt=2**63)]
    # Number of rigs of a collection; each is a dataset whose keys with `per: rig` are drawn anew.
    rigs: Annotated[int, Field(ge=1, le=MAX_RIGS)] | None = None
    # How random keys are drawn: independently, or each evenly over its range.
    random_method: Method = "uniform"
    # Keys that are drawn for every push or frame; set by the scene's loader.
    random_keys: tuple[RandomKey, ...] = ()
    # A preset of other keys, which the scene's own keys replace: laboratory is a table with things
    # on it, a clamp, dust on the beam, ambient light, two bounces, point spread and vignetting.
    look: Look | None = None
    # A grid of pushes, or random ones.
    pushes: PushSpec | None = None
    sampling: SamplingSpec | None = None
    # Names of parts of the set, a column of metadata.csv.
    splits: SplitSpec | None = None
    # The exact beam, or the paper's, (9) and (10), on which the paper's methods are unbiased.
    mechanics: Literal["exact", "linear"] = "exact"
    beam: BeamSpec = BeamSpec()
    # In the world, which is Sigma_a at motor angle zero; the motor's axis is along z.
    gravity_m_s2: Triple = (0.0, 0.0, 0.0)
    # Position of the beam's clamp relative to the motor's axis.
    clamp_offset_mm: Triple = (0.0, 0.0, 0.0)
    tolerances: ToleranceSpec = ToleranceSpec()
    camera: CameraSpec = CameraSpec()
    optics: OpticsSpec = OpticsSpec()
    # Motor speed while the shutter is open (sensor.exposure_s, and with a rolling shutter
    # sensor.line_time_us for each row).
    motor_speed_deg_s: Annotated[float, Field(ge=0, le=1e4)] = 0.0
    calibration: CalibrationSpec = CalibrationSpec()
    light: LightSpec = LightSpec()
    # In place of `light`.
    lights: tuple[AnyLight, ...] = ()
    # Light in the frames, relative to the light for which the exposure was metered and in which the
    # board and the beam at rest were photographed.
    light_level: Annotated[float, Field(ge=0.01, le=100)] = 1.0
    flicker: FlickerSpec | None = None
    ambient: AmbientSpec | None = None
    background: BackgroundSpec = BackgroundSpec()
    clutter: ClutterSpec | None = None
    wires: WiresSpec | None = None
    object: AnyObject = BlockSpec()
    second_peg: SecondPegSpec | None = None
    occlusion: OcclusionSpec | None = None
    hub: HubSpec = HubSpec()
    clamp: ClampSpec | None = None
    carriage: CarriageSpec | None = None
    sensor: SensorSpec = SensorSpec()
    moment_sensor: MomentSensorSpec | None = None
    force_sensor: ForceSensorSpec | None = None
    render: RenderSpec = RenderSpec()
    # Truth layers to keep of every frame; all of them take far more disk space than the image.
    layers: tuple[Layer, ...] = ("beam_mask",)
    frames_per_shard: Annotated[int, Field(ge=1, le=10_000)] = 16

    @property
    def motor_angle_at_contact_deg(self) -> Onset:
        """Range of the motor's angle at first contact."""
        pushes = self.pushes or self.sampling
        assert pushes is not None
        return pushes.motor_angle_at_contact_deg

    @property
    def light_setting(self) -> LightSetting:
        """What the places of lights may refer to."""
        camera = self.camera
        return LightSetting(camera.position_mm, camera.look_at_mm, self.background.distance_mm)

    @model_validator(mode="before")
    @classmethod
    def _add_preset(cls, keys: Any) -> Any:
        return with_preset(keys) if isinstance(keys, Mapping) else keys

    @model_validator(mode="after")
    def _check(self) -> "Scene":
        for check in CHECKS:
            check(self)
        return self
