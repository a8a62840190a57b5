"""The truth of a whole dataset, in truth/manifest.json: collected, written, checked when read."""

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
from pydantic import ValidationError

from solver.instrument.arrays import Floats
from solver.instrument.camera import Camera
from solver.instrument.errors import InputError, quoted
from solver.instrument.files import holds, sync_folder, write_bytes
from solver.instrument.hashes import HASHES, digest, hashes_bytes
from solver.instrument.keys import Keys
from solver.instrument.rig import RIGIDITIES_N_MM2, SIZES_MM
from solver.instrument.units import MILLIMETRE, NEWTON_SQUARE_MILLIMETRE
from vbaa_bench.dataset.document import mistake_sentence
from vbaa_bench.dataset.format_version import SCHEMA
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.dataset.program import versions
from vbaa_bench.scene.load import recorded_values
from vbaa_bench.scene.mistakes import unknown_kind
from vbaa_bench.scene.push import PushSpec
from vbaa_bench.scene.rigs import TrueRig
from vbaa_bench.scene.schema import Scene

# Chosen far beyond any rig: only mistakes in typing are rejected, and no product overflows.
_LARGEST: Final = 1e12
_MAX_SIDE_PX: Final = 100_000
# Longest name of a kind. Chosen: it is a label in tables.
_MAX_KIND_LENGTH: Final = 50
# Errors of a scene from another version of the program, which is readable nevertheless.
_OF_OTHER_VERSIONS: Final = ("missing", "extra_forbidden")


def dataset_facts(
    scene: Scene, rig: TrueRig, variant: str, exposure: float, sample_table: Floats
) -> dict[str, Any]:
    """Collect the truth of a whole dataset, for its manifest: lengths in mm.

    `exposure` is that of a radiance of 1, `sample_table` has the factors of numbers of samples.
    """
    camera, mm = rig.knocked(scene).camera, MILLIMETRE
    return {
        "scene": scene.model_dump(mode="json"),
        "seed": scene.seed,
        "variant": variant,
        "exposure_per_radiance": exposure,
        "sample_table": sample_table.tolist(),
        "true_rig": {
            "beam_length_mm": rig.beam.length / mm,
            "beam_diameter_mm": rig.beam.diameter / mm,
            "flexural_rigidity_n_mm2": rig.beam.flexural_rigidity / NEWTON_SQUARE_MILLIMETRE,
            "base_position_mm": (rig.base_position / mm).tolist(),
            "antenna_from_board": rig.antenna_from_board.tolist(),
            # A telecentric camera's fx and fy are in px/m.
            "camera": {
                "width_px": camera.width,
                "height_px": camera.height,
                "fx_px": camera.fx,
                "fy_px": camera.fy,
                "cx_px": camera.cx,
                "cy_px": camera.cy,
                "camera_from_antenna": camera.camera_from_antenna.tolist(),
                "telecentric": camera.telecentric,
                "distortion": list(camera.distortion),
            },
        },
    }


def seal(layout: Layout, facts: dict[str, Any], whole: Mapping[str, Mapping[str, str]]) -> None:
    """Write the manifest and the hashes of both trees; the last file completes the dataset.

    `whole` holds, by tree, the sha256 of each file except the manifest, computed when it was
    written. Files that exist with the right content are not written again. Raises OSError.
    """
    document = {"schema": SCHEMA, **facts, "versions": versions()}
    manifest = manifest_bytes(document)
    _write(layout.manifest, manifest)
    truth = {**whole["truth"], layout.manifest.name: digest(manifest)}
    _write(layout.truth / HASHES, hashes_bytes(truth))
    _write(layout.hashes, hashes_bytes(whole["observations"]))


def manifest_bytes(document: Mapping[str, Any]) -> bytes:
    """Encode a manifest as the content of manifest.json."""
    return (json.dumps(document, indent=2) + "\n").encode()


def _write(path: Path, data: bytes) -> None:
    if not holds(path, data):
        write_bytes(path, data)
        sync_folder(path.parent)


def true_camera(manifest: Mapping[str, Any]) -> Camera:
    """Return the camera with which the frames were rendered, as a checked manifest states it."""
    values = manifest["true_rig"]["camera"]
    return Camera(
        width=values["width_px"],
        height=values["height_px"],
        fx=values["fx_px"],
        fy=values["fy_px"],
        cx=values["cx_px"],
        cy=values["cy_px"],
        camera_from_antenna=np.array(values["camera_from_antenna"]),
        telecentric=values["telecentric"],
        distortion=tuple(values["distortion"]),
    )


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
    of_camera = (
        *camera,
        "width_px",
        "height_px",
        "camera_from_antenna",
        "telecentric",
        "distortion",
    )
    for name in (*rig, "base_position_mm", *(f"camera.{name}" for name in of_camera)):
        if not key.has(f"true_rig.{name}"):
            raise _not_generated(path, f"true_rig.{name}")
    for name, bounds in zip(rig, (SIZES_MM, SIZES_MM, RIGIDITIES_N_MM2), strict=True):
        key.number(f"true_rig.{name}", *bounds)
    for name in camera:
        key.number(f"true_rig.camera.{name}", -_LARGEST, _LARGEST)
    for name in ("width_px", "height_px"):
        key.count(f"true_rig.camera.{name}", 1, _MAX_SIDE_PX)
    key.triple("true_rig.base_position_mm", -_LARGEST, _LARGEST)
    camera_values = manifest["true_rig"]["camera"]
    if not isinstance(camera_values["telecentric"], bool):
        key.refuse("true_rig.camera.telecentric", "true or false")
    if not _numbers(camera_values["distortion"], (0, 5, 8)):
        key.refuse("true_rig.camera.distortion", "a list of 0, 5 or 8 numbers")
    pose = camera_values["camera_from_antenna"]
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
        unknown = [mistake["loc"] for mistake in error.errors() if _is_unknown_kind(mistake)]
        for mistake in error.errors():
            # A list of which an item is unknown has an error, too.
            within = any(key[: len(mistake["loc"])] == mistake["loc"] for key in unknown)
            if mistake["type"] not in _OF_OTHER_VERSIONS and not within:
                raise InputError(mistake_sentence(path, mistake, "scene")) from error
    pushes = PushSpec(contact_distance_mm=(1.0,), deflection_pct=(1.0,))
    defaults = Scene(title="-", seed=0, pushes=pushes).model_dump(mode="json")
    return _filled(scene, {**defaults, "pushes": None})


def _is_unknown_kind(mistake: Any) -> bool:
    """Test whether a key or section is of a kind that this process does not know.

    It is that of a user's module or of another version. Reading needs no module, and loads none.
    """
    kind = unknown_kind(mistake)
    return kind is not None and kind.isidentifier() and len(kind) <= _MAX_KIND_LENGTH


def _filled(values: dict[str, Any], defaults: dict[str, Any]) -> dict[str, Any]:
    """Add the defaults of missing keys, also within sections of the same kind."""
    filled = {**defaults, **values}
    for name, default in defaults.items():
        value = filled[name]
        if isinstance(value, dict) and isinstance(default, dict):
            same_kind = value.get("kind") == default.get("kind")
            filled[name] = _filled(value, default) if same_kind else value
    return filled
