"""The scene: every number of a simulated experiment, as in its YAML file.

Units are in the names. Defaults describe the paper's rig (section VI).
"""

import math
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
from vbaa_bench.scene.lighting import (
    AmbientSpec,
    BackgroundSpec,
    FlickerSpec,
    LampSpec,
    LightSpec,
)
from vbaa_bench.scene.objects import (
    BlockSpec,
    NothingSpec,
    ObjectSpec,
    OcclusionSpec,
    SecondPegSpec,
)
from vbaa_bench.scene.optics import OpticsSpec
from vbaa_bench.scene.part import (
    Onset,
    Part,
    Triple,
)
from vbaa_bench.scene.presets import Look, with_preset
from vbaa_bench.scene.push_spec import MAX_FRAMES, PushSpec
from vbaa_bench.scene.random_keys import RandomKey
from vbaa_bench.scene.rendering import Layer, RenderSpec
from vbaa_bench.scene.sampling import SamplingSpec, SplitSpec
from vbaa_bench.scene.unit_values import Method
from vbaa_bench.scene.weight import WeightSpec, weight_mistake
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
    # The exact beam, or the paper's, (9) and (10), on which the paper's methods are unbiased.
    # Names of parts of the set, a column of metadata.csv.
    splits: SplitSpec | None = None
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
    lights: tuple[LampSpec, ...] = ()
    # Light in the frames, relative to the light for which the exposure was metered and in which the
    # board and the beam at rest were photographed.
    light_level: Annotated[float, Field(ge=0.01, le=100)] = 1.0
    flicker: FlickerSpec | None = None
    ambient: AmbientSpec | None = None
    background: BackgroundSpec = BackgroundSpec()
    clutter: ClutterSpec | None = None
    wires: WiresSpec | None = None
    object: ObjectSpec = BlockSpec()
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

    @model_validator(mode="before")
    @classmethod
    def _add_preset(cls, keys: Any) -> Any:
        return with_preset(keys) if isinstance(keys, Mapping) else keys

    @model_validator(mode="after")
    def _check_lamp_height(self) -> "Scene":
        camera, lamp = self.camera.position_mm[2], self.light.height_mm
        if self.lights and self.light != LightSpec():
            raise ValueError("light and lights are both given, allowed is one of them")
        if self.lights and camera > 0:
            return self
        if not 0 < camera < lamp:
            raise ValueError(
                f"camera.position_mm has height {camera:g} and light.height_mm is {lamp:g}; "
                "allowed is 0 < camera < light, so that the lamp shines from behind the camera"
            )
        return self

    @model_validator(mode="after")
    def _check_lamp_positions(self) -> "Scene":
        ground = self.background.distance_mm
        for lamp in self.lights:
            position = getattr(lamp, "position_mm", None)
            aim = getattr(lamp, "aim_mm", None) or self.camera.look_at_mm
            if position == aim:
                raise ValueError(
                    f"lights: position_mm is equal to the aim, {list(aim)}, for one of kind "
                    f"{lamp.kind}; allowed is any other position"
                )
            if lamp.kind == "back" and lamp.height_above_background_mm >= ground:
                raise ValueError(
                    "lights: a back panel's height_above_background_mm is "
                    f"{lamp.height_above_background_mm:g}, allowed is less than "
                    f"background.distance_mm, {ground:g}, or it would be above plane C"
                )
        return self

    @model_validator(mode="after")
    def _check_clamp(self) -> "Scene":
        clamp, ground = self.clamp, self.background.distance_mm
        if clamp is not None and clamp.jaw_mm[2] / 2 + clamp.flange_thickness_mm >= ground:
            raise ValueError(
                f"clamp: half the jaw's height and the flange are "
                f"{clamp.jaw_mm[2] / 2 + clamp.flange_thickness_mm:g} mm high, allowed is less "
                f"than background.distance_mm, {ground:g}"
            )
        return self

    @model_validator(mode="after")
    def _check_clutter(self) -> "Scene":
        ground = self.background.distance_mm
        if self.clutter is not None and self.clutter.highest_mm(-ground) <= -ground:
            raise ValueError(
                f"clutter.top_mm is {self.clutter.top_mm:g}, allowed is above the background, "
                f"{-ground:g}"
            )
        return self

    @model_validator(mode="after")
    def _check_wires(self) -> "Scene":
        wires = self.wires
        if wires is None:
            return self
        if self.clamp is not None:
            raise ValueError(
                "wires and clamp are both given, allowed is one of them: the clamp's cable would "
                "pass through the wires"
            )
        for name, part in (("object", self.object), ("second_peg", self.second_peg)):
            if part is None or isinstance(part, NothingSpec):
                continue
            bottom = getattr(part, "bottom_mm", None)
            if bottom is None or bottom <= wires.highest_mm:
                raise ValueError(
                    f"{name}.bottom_mm is {bottom}, allowed is above the wires, whose highest "
                    f"point is {wires.highest_mm:g} mm above plane C"
                )
        below = -self.background.distance_mm
        if self.clutter is not None:
            below = self.clutter.highest_mm(below)
        for lamp in self.lights:
            if lamp.kind == "back":
                panel = lamp.height_above_background_mm - self.background.distance_mm
                below = max(below, panel)
        if wires.lowest_mm <= below:
            raise ValueError(
                f"wires.height_mm begins at {wires.height_mm[0]:g}, so that the lowest point is "
                f"{wires.lowest_mm:g}; allowed is above the ground and what is on it, {below:g}"
            )
        return self

    @model_validator(mode="after")
    def _check_pushes(self) -> "Scene":
        if (self.pushes is None) == (self.sampling is None):
            raise ValueError("exactly one of pushes and sampling must be given")
        if self.pushes is not None:
            wall = self.object.kind == "wall"
            if (self.pushes.contact_distance_mm is None) != wall:
                raise ValueError(
                    "pushes.contact_distance_mm must be given, except for a wall, which has none"
                )
            angles = self.pushes.pushing_angle_deg
            if wall and angles is None:
                raise ValueError("a wall needs pushing_angle_deg, a deflection is not allowed")
            if self.object.kind == "none" and (angles is None or max(angles) > 0):
                raise ValueError(
                    "object.kind is none, so there is no contact: pushing_angle_deg must be <= 0"
                )
        return self

    @model_validator(mode="after")
    def _check_frame_count(self) -> "Scene":
        axes = {"sampling.count": self.sampling.count if self.sampling else 1}
        if self.pushes is not None:
            steps = self.pushes.deflection_pct or self.pushes.pushing_angle_deg or ()
            axes = {
                "contact distances": len(self.pushes.contact_distance_mm or (None,)),
                "normals": len(self.pushes.normal_deg),
                "stiffnesses": len(self.pushes.stiffness_n_m),
                "repeats": self.pushes.repeats,
                "steps": len(steps),
            }
        if self.occlusion is not None:
            occlusion = self.occlusion
            axes["occlusions"] = (
                len(occlusion.kind) * len(occlusion.place) * len(occlusion.availability)
            )
        frames = math.prod(axes.values())
        if frames > MAX_FRAMES:
            product = " x ".join(f"{count:,} {name}" for name, count in axes.items() if count > 1)
            raise ValueError(f"{product} are {frames:,} frames, allowed are {MAX_FRAMES:,}")
        return self

    @model_validator(mode="after")
    def _check_sampling(self) -> "Scene":
        if self.sampling is not None and self.object.kind in ("none", "wall"):
            raise ValueError(
                f"object.kind is {self.object.kind}, which has no contact distance to sample; "
                "allowed with sampling is any other"
            )
        return self

    @model_validator(mode="after")
    def _check_weight(self) -> "Scene":
        if not isinstance(self.object, WeightSpec):
            return self
        # A hung weight's motion and its other supports are not modelled.
        parts = {
            "sampling": self.sampling,
            "second_peg": self.second_peg,
            "carriage": self.carriage,
            "motor_speed_deg_s": self.motor_speed_deg_s,
        }
        pushes = self.pushes or PushSpec(pushing_angle_deg=(0.0,))
        parts["pushes.stiffness_n_m"] = any(k != "rigid" for k in pushes.stiffness_n_m)
        mistake = weight_mistake(
            self.gravity_m_s2,
            pushes.deflection_pct,
            pushes.normal_deg,
            [name for name, value in parts.items() if value],
        )
        if mistake is not None:
            raise ValueError(mistake)
        return self

    @model_validator(mode="after")
    def _check_strip(self) -> "Scene":
        if self.beam.section != "strip":
            return self
        angle = self.beam.section_angle_deg
        normals = self.pushes.normal_deg if self.pushes else ()
        normals += self.sampling.normal_deg if self.sampling else ()
        if self.object.kind not in ("block", "knife_edge") or self.second_peg:
            raise ValueError("a strip needs a single object, block or knife_edge")
        if any(normal != angle for normal in normals):
            raise ValueError(
                f"a strip whose section_angle_deg is {angle:g} needs an edge of the same "
                f"normal_deg, not of {list(normals)}"
            )
        return self

    @model_validator(mode="after")
    def _check_motion(self) -> "Scene":
        sensor = self.sensor
        readout_s = sensor.line_time_s * (self.camera.height_px - 1)
        rotation = self.motor_speed_deg_s * (sensor.exposure_s + readout_s)
        if rotation > 5:
            rolling = f" and sensor.line_time_us is {sensor.line_time_us:g}" if readout_s else ""
            raise ValueError(
                f"motor_speed_deg_s is {self.motor_speed_deg_s:g} and sensor.exposure_s is "
                f"{sensor.exposure_s:g}{rolling}: the motor turns by {rotation:g} degrees while "
                "the shutter is open, allowed is up to 5"
            )
        if rotation and self.object.kind == "none":
            raise ValueError("motor_speed_deg_s is given, but object.kind is none")
        history_keys = [name for name in ("friction",) if getattr(self.object, name, 0)]
        history_keys += ["drift_mm"] if any(getattr(self.object, "drift_mm", ())) else []
        if self.motor_speed_deg_s and history_keys:
            raise ValueError(
                f"motor_speed_deg_s is {self.motor_speed_deg_s:g} and object.{history_keys[0]} is "
                "given; allowed is one of them: blur is modelled for a frictionless push"
            )
        return self

    @model_validator(mode="after")
    def _check_views(self) -> "Scene":
        if self.camera.projection == "perspective" and self.calibration.views < 3:
            raise ValueError(
                f"calibration.views is {self.calibration.views}, allowed is >= 3 for a "
                "perspective camera"
            )
        return self

    @model_validator(mode="after")
    def _check_clamp_offset(self) -> "Scene":
        for name in ("clamp_offset_mm", "grip_mm"):
            value = getattr(self.tolerances, name)
            if value and self.camera.mount == "world":
                raise ValueError(
                    f"tolerances.{name} is {value:g}, allowed is 0 for a camera whose mount is "
                    "world"
                )
        return self

    @model_validator(mode="after")
    def _check_linear(self) -> "Scene":
        beam, default = self.beam, BeamSpec()
        unsupported = [
            name
            for name in ("section", "tip_ratio", "bow_mm", "extensible", "clamp_softness")
            if getattr(beam, name) != getattr(default, name)
        ]
        unsupported += [f"object.{name}" for name in ("friction",) if getattr(self.object, name, 0)]
        unsupported += ["gravity_m_s2"] if any(self.gravity_m_s2) else []
        unsupported += ["clamp_offset_mm"] if any(self.clamp_offset_mm) else []
        unsupported += ["second_peg"] if self.second_peg else []
        unsupported += ["object.drift_mm"] if any(getattr(self.object, "drift_mm", ())) else []
        if self.object.kind not in ("block", "knife_edge", "plunger"):
            unsupported.append(f"object.kind {self.object.kind}")
        if self.mechanics == "linear" and unsupported:
            raise ValueError(
                f"mechanics is linear, without a model of {', '.join(unsupported)}; "
                "allowed is exact"
            )
        return self
