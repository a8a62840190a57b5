"""Checked content of truth/manifest.json: the true rig, and the scene as it was read."""

import math
from pathlib import Path
from typing import Any, Final

from pydantic import ValidationError

from solver.instrument.errors import InputError, quoted
from solver.instrument.keys import Keys
from solver.instrument.rig import RIGIDITIES_N_MM2, SIZES_MM
from vbaa_bench.dataset.document import mistake_sentence
from vbaa_bench.scene.load import recorded_values
from vbaa_bench.scene.push import PushSpec
from vbaa_bench.scene.schema import Scene

# Chosen far beyond any rig: only mistakes in typing are rejected, and no product overflows.
_LARGEST: Final = 1e12
_MAX_SIDE_PX: Final = 100_000
# Longest name of a kind. Chosen: it is a label in tables.
_MAX_KIND_LENGTH: Final = 50
# Errors of a scene from another version of the program, which is readable nevertheless.
_OF_OTHER_VERSIONS: Final = ("missing", "extra_forbidden")


def checked_manifest(path: Path, manifest: dict[str, Any]) -> dict[str, Any]:
    """Check a manifest; return it with defaults for keys that its scene lacks.

    Raises InputError, which names the first key that is missing or wrong.
    """
    key = Keys(path, manifest)
    for name in ("scene", "seed", "variant", "true_rig"):
        if not key.has(name):
            raise _not_generated(path, name)
    if not isinstance(manifest["variant"], str):
        key.refuse("variant", "a text")
    key.count("seed", 0, 2**64)
    rig = ("beam_length_mm", "beam_diameter_mm", "flexural_rigidity_n_mm2")
    camera = ("fx_px", "fy_px", "cx_px", "cy_px")
    others = ("base_position_mm", *(f"camera.{name}" for name in (*camera, "width_px")))
    others += ("camera.height_px", "camera.camera_from_antenna", "camera.telecentric")
    for name in (*rig, *others, "camera.distortion"):
        if not key.has(f"true_rig.{name}"):
            raise _not_generated(path, f"true_rig.{name}")
    for name, bounds in zip(rig, (SIZES_MM, SIZES_MM, RIGIDITIES_N_MM2), strict=True):
        key.number(f"true_rig.{name}", *bounds)
    for name in camera:
        key.number(f"true_rig.camera.{name}", -_LARGEST, _LARGEST)
    for name in ("width_px", "height_px"):
        key.count(f"true_rig.camera.{name}", 1, _MAX_SIDE_PX)
    key.triple("true_rig.base_position_mm", -_LARGEST, _LARGEST)
    seen = manifest["true_rig"]["camera"]
    if not isinstance(seen["telecentric"], bool):
        key.refuse("true_rig.camera.telecentric", "true or false")
    if not _numbers(seen["distortion"], (0, 5, 8)):
        key.refuse("true_rig.camera.distortion", "a list of 0, 5 or 8 numbers")
    pose = seen["camera_from_antenna"]
    if not (isinstance(pose, list) and len(pose) == 4 and all(_numbers(row, (4,)) for row in pose)):
        key.refuse("true_rig.camera.camera_from_antenna", "four rows of four numbers")
    return {**manifest, "scene": _checked_scene(path, manifest["scene"])}


def _numbers(values: Any, lengths: tuple[int, ...]) -> bool:
    return (
        isinstance(values, list)
        and len(values) in lengths
        and all(isinstance(value, int | float) and math.isfinite(value) for value in values)
    )


def _not_generated(path: Path, name: str) -> InputError:
    return InputError(
        f"{path}: the key {name} is missing; this manifest was not written by generate"
    )


def _checked_scene(path: Path, scene: Any) -> dict[str, Any]:
    if not isinstance(scene, dict):
        raise InputError(f"{path}: scene is {quoted(scene)}, allowed are keys and values")
    try:
        Scene.model_validate(recorded_values(scene, path))
    except ValidationError as error:
        for mistake in error.errors():
            if mistake["type"] not in _OF_OTHER_VERSIONS and not _is_unknown_kind(mistake):
                raise InputError(mistake_sentence(path, mistake, "scene")) from error
    pushes = PushSpec(contact_distance_mm=(1.0,), deflection_pct=(1.0,))
    defaults = Scene(title="-", seed=0, pushes=pushes).model_dump(mode="json")
    return _filled(scene, {**defaults, "pushes": None})


def _is_unknown_kind(mistake: Any) -> bool:
    """Test whether a section is of a kind that this process does not know.

    It is that of a user's module or of another version. Reading needs no module, and loads none.
    """
    if mistake["type"] != "union_tag_invalid":
        return False
    kind = mistake["input"]["kind"]
    return isinstance(kind, str) and kind.isidentifier() and len(kind) <= _MAX_KIND_LENGTH


def _filled(values: dict[str, Any], defaults: dict[str, Any]) -> dict[str, Any]:
    """Add the defaults of missing keys, also within sections of the same kind."""
    filled = {**defaults, **values}
    for name, default in defaults.items():
        value = filled[name]
        if isinstance(value, dict) and isinstance(default, dict):
            same_kind = value.get("kind") == default.get("kind")
            filled[name] = _filled(value, default) if same_kind else value
    return filled
