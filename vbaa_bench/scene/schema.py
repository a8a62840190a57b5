"""The scene: every number of a simulated experiment, as in its YAML file.

Units are in the names. Defaults describe the paper's rig (section VI).
"""

from collections.abc import Mapping
from typing import Annotated, Any, Final, Literal

from pydantic import Field, model_validator

from vbaa_bench.scene.background import BackgroundSpec
from vbaa_bench.scene.beam import BeamSpec, ToleranceSpec
from vbaa_bench.scene.camera import CalibrationSpec, CameraSpec, OpticsSpec
from vbaa_bench.scene.clutter import ClutterSpec
from vbaa_bench.scene.image_sensor import SensorSpec
from vbaa_bench.scene.laboratory import (
    CarriageSpec,
    ClampSpec,
    ForceSensorSpec,
    HubSpec,
    MomentSensorSpec,
)
from vbaa_bench.scene.lights.ambient import AmbientSpec
from vbaa_bench.scene.lights.flicker import FlickerSpec
from vbaa_bench.scene.lights.light import AnyLight, LightSetting
from vbaa_bench.scene.lights.soft import LightSpec
from vbaa_bench.scene.objects.block import BlockSpec
from vbaa_bench.scene.objects.object import AnyObject
from vbaa_bench.scene.objects.peg import SecondPegSpec
from vbaa_bench.scene.occlusion import OcclusionSpec
from vbaa_bench.scene.part import (
    Onset,
    Part,
    Triple,
)
from vbaa_bench.scene.presets import Look, with_preset
from vbaa_bench.scene.push import PushSpec
from vbaa_bench.scene.random_keys import RandomKey
from vbaa_bench.scene.rendering import Layer, RenderSpec
from vbaa_bench.scene.sampling import SamplingSpec, SplitSpec
from vbaa_bench.scene.scene_checks import CHECKS
from vbaa_bench.scene.unit_values import Method
from vbaa_bench.scene.wires import WiresSpec

# Chosen: each takes seconds and a megabyte.
MAX_RIGS: Final = 1_000_000


class Scene(Part):
    """One experiment. Together with its seed it determines every byte of the truth."""

    title: Annotated[str, Field(min_length=1)] = Field(
        description="Title of the scene, for reports; it changes no image."
    )
    seed: Annotated[int, Field(ge=0, lt=2**63)] = Field(description="Seed of all random numbers.")
    rigs: Annotated[int, Field(ge=1, le=MAX_RIGS)] | None = Field(
        default=None,
        description="Number of rigs of a collection; each is a dataset whose keys with `per: "
        "rig` are drawn anew.",
    )
    random_method: Method = Field(
        default="uniform",
        description="How random keys are drawn: independently, or each evenly over its range.",
    )
    random_keys: tuple[RandomKey, ...] = Field(
        default=(),
        description="Keys that are drawn for every push or frame; set by the scene's loader.",
    )
    look: Look | None = Field(
        default=None,
        description="A preset of other keys, which the scene's own keys replace: laboratory "
        "is a table with things on it, a clamp, dust on the beam, ambient light, two bounces, "
        "point spread and vignetting.",
    )
    pushes: PushSpec | None = Field(default=None, description="A grid of pushes.")
    sampling: SamplingSpec | None = Field(
        default=None, description="Random pushes, in place of `pushes`."
    )
    splits: SplitSpec | None = Field(
        default=None, description="Names of parts of the set, a column of metadata.csv."
    )
    mechanics: Literal["exact", "linear"] = Field(
        default="exact",
        description="The exact beam, or the paper's, (9) and (10), on which the paper's "
        "methods are unbiased.",
    )
    beam: BeamSpec = Field(default=BeamSpec(), description="The beam.")
    gravity_m_s2: Triple = Field(
        default=(0.0, 0.0, 0.0),
        description="Gravity in the world, which is Sigma_a at motor angle zero; the motor's "
        "axis is along z.",
    )
    clamp_offset_mm: Triple = Field(
        default=(0.0, 0.0, 0.0),
        description="Position of the beam's clamp relative to the motor's axis.",
    )
    tolerances: ToleranceSpec = Field(
        default=ToleranceSpec(), description="Stated accuracy of the rig."
    )
    camera: CameraSpec = Field(default=CameraSpec(), description="The camera.")
    optics: OpticsSpec = Field(default=OpticsSpec(), description="The lens.")
    motor_speed_deg_s: Annotated[float, Field(ge=0, le=1e4)] = Field(
        default=0.0,
        description="Motor speed while the shutter is open: during sensor.exposure_s, and "
        "with a rolling shutter sensor.line_time_us for each row.",
    )
    calibration: CalibrationSpec = Field(
        default=CalibrationSpec(), description="The calibration target and its images."
    )
    light: LightSpec = Field(default=LightSpec(), description="One soft lamp behind the camera.")
    lights: tuple[AnyLight, ...] = Field(default=(), description="Lamps in place of `light`.")
    light_level: Annotated[float, Field(ge=0.01, le=100)] = Field(
        default=1.0,
        description="Light in the frames, relative to the light for which the exposure was "
        "metered and in which the board and the beam at rest were photographed.",
    )
    flicker: FlickerSpec | None = Field(
        default=None, description="Flicker of all lamps on alternating current."
    )
    ambient: AmbientSpec | None = Field(
        default=None, description="Even light from all directions, in addition to the lamps."
    )
    background: BackgroundSpec = Field(default=BackgroundSpec(), description="The ground.")
    clutter: ClutterSpec | None = Field(
        default=None, description="Things that lie about on the ground."
    )
    wires: WiresSpec | None = Field(
        default=None, description="Thin wires that cross the beam in the image."
    )
    object: AnyObject = Field(
        default=BlockSpec(), description="The object that the beam is pushed against."
    )
    second_peg: SecondPegSpec | None = Field(default=None, description="A second contact.")
    occlusion: OcclusionSpec | None = Field(
        default=None, description="What hides the beam from the camera."
    )
    hub: HubSpec = Field(default=HubSpec(), description="The motor's hub.")
    clamp: ClampSpec | None = Field(default=None, description="The clamp in front of the hub.")
    carriage: CarriageSpec | None = Field(
        default=None, description="A carriage that brings the antenna to the object."
    )
    sensor: SensorSpec = Field(default=SensorSpec(), description="The image sensor.")
    moment_sensor: MomentSensorSpec | None = Field(
        default=None, description="A sensor of the moment at the clamp."
    )
    force_sensor: ForceSensorSpec | None = Field(
        default=None, description="A sensor of force and moment at the clamp."
    )
    render: RenderSpec = Field(default=RenderSpec(), description="Accuracy of the rendering.")
    layers: tuple[Layer, ...] = Field(
        default=("beam_mask",),
        description="Truth layers to keep of every frame; all of them take far more disk "
        "space than the image.",
    )
    frames_per_shard: Annotated[int, Field(ge=1, le=10_000)] = Field(
        default=16, description="Number of frames in a folder of the dataset."
    )

    @property
    def push_keys(self) -> PushSpec | SamplingSpec:
        """The keys of its pushes: those of a grid, or of random ones."""
        keys = self.pushes or self.sampling
        assert keys is not None
        return keys

    @property
    def motor_angle_at_contact_deg(self) -> Onset:
        """Range of the motor's angle at first contact."""
        return self.push_keys.motor_angle_at_contact_deg

    @property
    def ground_turns(self) -> bool:
        """Whether the ground turns against the camera."""
        return self.background.fixed_to != self.camera.mount

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
