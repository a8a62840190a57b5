"""What the parts of a scene must not contradict: each check raises ValueError."""

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Final

from vbaa_bench.scene.beam import BeamSpec
from vbaa_bench.scene.lights.soft import LightSpec
from vbaa_bench.scene.objects.weight import weight_mistake
from vbaa_bench.scene.push import MAX_FRAMES, PushSpec

if TYPE_CHECKING:
    from vbaa_bench.scene.schema import Scene


def _lamp_height(scene: "Scene") -> None:
    camera, lamp = scene.camera.position_mm[2], scene.light.height_mm
    if scene.lights and scene.light != LightSpec():
        raise ValueError("light and lights are both given, allowed is one of them")
    if scene.lights and camera > 0:
        return
    if not 0 < camera < lamp:
        raise ValueError(
            f"camera.position_mm has height {camera:g} and light.height_mm is {lamp:g}; "
            "allowed is 0 < camera < light, so that the lamp shines from behind the camera"
        )


def _lamp_positions(scene: "Scene") -> None:
    for lamp in scene.lights:
        if mistake := lamp.mistake(scene.light_setting):
            raise ValueError(f"lights: {mistake}")
    around = [lamp.kind for lamp in scene.lights if lamp.surrounds]
    if len(around) > 1:
        raise ValueError(
            f"lights: {' and '.join(around)} are all around, allowed is one such light"
        )


def _clamp(scene: "Scene") -> None:
    clamp, ground = scene.clamp, scene.background.distance_mm
    if clamp is not None and clamp.jaw_mm[2] / 2 + clamp.flange_thickness_mm >= ground:
        raise ValueError(
            f"clamp: half the jaw's height and the flange are "
            f"{clamp.jaw_mm[2] / 2 + clamp.flange_thickness_mm:g} mm high, allowed is less "
            f"than background.distance_mm, {ground:g}"
        )


def _clutter(scene: "Scene") -> None:
    ground = scene.background.distance_mm
    if scene.clutter is not None and scene.clutter.highest_mm(-ground) <= -ground:
        raise ValueError(
            f"clutter.top_mm is {scene.clutter.top_mm:g}, allowed is above the background, "
            f"{-ground:g}"
        )


def _wires(scene: "Scene") -> None:
    wires = scene.wires
    if wires is None:
        return
    if scene.clamp is not None:
        raise ValueError(
            "wires and clamp are both given, allowed is one of them: the clamp's cable would "
            "pass through the wires"
        )
    parts = {"object": scene.object if scene.object.present else None}
    for name, part in (parts | {"second_peg": scene.second_peg}).items():
        if part is None:
            continue
        bottom = getattr(part, "bottom_mm", None)
        if bottom is None or bottom <= wires.highest_mm:
            raise ValueError(
                f"{name}.bottom_mm is {bottom}, allowed is above the wires, whose highest "
                f"point is {wires.highest_mm:g} mm above plane C"
            )
    below = -scene.background.distance_mm
    if scene.clutter is not None:
        below = scene.clutter.highest_mm(below)
    panels = (lamp.panel_mm(scene.light_setting) for lamp in scene.lights)
    below = max([below, *(height for height in panels if height is not None)])
    if wires.lowest_mm <= below:
        raise ValueError(
            f"wires.height_mm begins at {wires.height_mm[0]:g}, so that the lowest point is "
            f"{wires.lowest_mm:g}; allowed is above the ground and what is on it, {below:g}"
        )


def _pushes(scene: "Scene") -> None:
    if (scene.pushes is None) == (scene.sampling is None):
        raise ValueError("exactly one of pushes and sampling must be given")
    if scene.pushes is not None:
        wall = scene.object.gap() is not None
        if (scene.pushes.contact_distance_mm is None) != wall:
            raise ValueError(
                "pushes.contact_distance_mm must be given, except for a wall, which has none"
            )
        angles = scene.pushes.pushing_angle_deg
        if wall and angles is None:
            raise ValueError("a wall needs pushing_angle_deg, a deflection is not allowed")
        if not scene.object.present and (angles is None or max(angles) > 0):
            raise ValueError(
                "object.kind is none, so there is no contact: pushing_angle_deg must be <= 0"
            )


def _frame_count(scene: "Scene") -> None:
    axes = {"sampling.count": scene.sampling.count if scene.sampling else 1}
    if scene.pushes is not None:
        steps = scene.pushes.deflection_pct or scene.pushes.pushing_angle_deg or ()
        axes = {
            "contact distances": len(scene.pushes.contact_distance_mm or (None,)),
            "normals": len(scene.pushes.normal_deg),
            "stiffnesses": len(scene.pushes.stiffness_n_m),
            "repeats": scene.pushes.repeats,
            "steps": len(steps),
        }
    if scene.occlusion is not None:
        occlusion = scene.occlusion
        axes["occlusions"] = (
            len(occlusion.kind) * len(occlusion.place) * len(occlusion.availability)
        )
    frames = math.prod(axes.values())
    if frames > MAX_FRAMES:
        product = " x ".join(f"{count:,} {name}" for name, count in axes.items() if count > 1)
        raise ValueError(f"{product} are {frames:,} frames, allowed are {MAX_FRAMES:,}")


def _sampling(scene: "Scene") -> None:
    has_distance = scene.object.present and scene.object.gap() is None
    if scene.sampling is not None and not has_distance:
        raise ValueError(
            f"object.kind is {scene.object.kind}, which has no contact distance to sample; "
            "allowed with sampling is any other"
        )


def _weight(scene: "Scene") -> None:
    if scene.object.mass() is None:
        return
    # A hung weight's motion and its other supports are not modelled.
    parts = {
        "sampling": scene.sampling,
        "second_peg": scene.second_peg,
        "carriage": scene.carriage,
        "motor_speed_deg_s": scene.motor_speed_deg_s,
    }
    pushes = scene.pushes or PushSpec(pushing_angle_deg=(0.0,))
    parts["pushes.stiffness_n_m"] = any(k != "rigid" for k in pushes.stiffness_n_m)
    mistake = weight_mistake(
        scene.gravity_m_s2,
        pushes.deflection_pct,
        pushes.normal_deg,
        [name for name, value in parts.items() if value],
    )
    if mistake is not None:
        raise ValueError(mistake)


def _strip(scene: "Scene") -> None:
    if not scene.beam.section_shape.is_flat:
        return
    angle = scene.beam.section_angle_deg
    normals = scene.pushes.normal_deg if scene.pushes else ()
    normals += scene.sampling.normal_deg if scene.sampling else ()
    if not scene.object.sharp or scene.second_peg:
        raise ValueError("a strip needs a single object, block or knife_edge")
    if any(normal != angle for normal in normals):
        raise ValueError(
            f"a strip whose section_angle_deg is {angle:g} needs an edge of the same "
            f"normal_deg, not of {list(normals)}"
        )


def _motion(scene: "Scene") -> None:
    sensor = scene.sensor
    readout_s = sensor.line_time_s * (scene.camera.height_px - 1)
    rotation = scene.motor_speed_deg_s * (sensor.exposure_s + readout_s)
    if rotation > 5:
        rolling = f" and sensor.line_time_us is {sensor.line_time_us:g}" if readout_s else ""
        raise ValueError(
            f"motor_speed_deg_s is {scene.motor_speed_deg_s:g} and sensor.exposure_s is "
            f"{sensor.exposure_s:g}{rolling}: the motor turns by {rotation:g} degrees while "
            "the shutter is open, allowed is up to 5"
        )
    if rotation and not scene.object.present:
        raise ValueError("motor_speed_deg_s is given, but object.kind is none")
    history_keys = ["friction"] if scene.object.friction_coefficient() else []
    history_keys += ["drift_mm"] if any(scene.object.drift()) else []
    if scene.motor_speed_deg_s and history_keys:
        raise ValueError(
            f"motor_speed_deg_s is {scene.motor_speed_deg_s:g} and object.{history_keys[0]} is "
            "given; allowed is one of them: blur is modelled for a frictionless push"
        )


def _views(scene: "Scene") -> None:
    if not scene.camera.is_telecentric and scene.calibration.views < 3:
        raise ValueError(
            f"calibration.views is {scene.calibration.views}, allowed is >= 3 for a "
            "perspective camera"
        )


def _clamp_offset(scene: "Scene") -> None:
    for name in ("clamp_offset_mm", "grip_mm"):
        value = getattr(scene.tolerances, name)
        if value and scene.camera.mount == "world":
            raise ValueError(
                f"tolerances.{name} is {value:g}, allowed is 0 for a camera whose mount is world"
            )


def _linear(scene: "Scene") -> None:
    beam, default = scene.beam, BeamSpec()
    unsupported = [
        name
        for name in ("section", "tip_ratio", "bow_mm", "extensible", "clamp_softness")
        if getattr(beam, name) != getattr(default, name)
    ]
    unsupported += ["object.friction"] if scene.object.friction_coefficient() else []
    unsupported += ["gravity_m_s2"] if any(scene.gravity_m_s2) else []
    unsupported += ["clamp_offset_mm"] if any(scene.clamp_offset_mm) else []
    unsupported += ["second_peg"] if scene.second_peg else []
    unsupported += ["object.drift_mm"] if any(scene.object.drift()) else []
    if not scene.object.linear:
        unsupported.append(f"object.kind {scene.object.kind}")
    if scene.mechanics == "linear" and unsupported:
        raise ValueError(
            f"mechanics is linear, without a model of {', '.join(unsupported)}; allowed is exact"
        )


CHECKS: Final[tuple[Callable[["Scene"], None], ...]] = (
    _lamp_height,
    _lamp_positions,
    _clamp,
    _clutter,
    _wires,
    _pushes,
    _frame_count,
    _sampling,
    _weight,
    _strip,
    _motion,
    _views,
    _clamp_offset,
    _linear,
)
