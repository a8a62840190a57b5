"""Identity of a dataset: its scene and the program that makes it. `generate` rejects mismatches."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Literal

from solver.instrument.errors import InputError
from solver.instrument.files import sha256, write_bytes
from solver.instrument.hashes import digest, parse_hashes
from vbaa_bench.dataset.code import code_digests
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.dataset.manifest import read_json, versions
from vbaa_bench.scene.load import SceneFile
from vbaa_bench.scene.objects import MeshSpec
from vbaa_bench.scene.paint import ImageTextureSpec

Identity = dict[str, Any]


def dataset_identity(file: SceneFile, variant: str) -> Identity:
    """Collect everything that the bytes of a dataset depend on, without the scene's title."""
    scene = file.scene
    texture = getattr(scene.object, "texture", None)
    names = [scene.object.file] if isinstance(scene.object, MeshSpec) else []
    names += [light.file for light in scene.lights if light.kind == "environment" and light.file]
    names += [scene.background.image_file] if scene.background.image_file else []
    names += [texture.file] if isinstance(texture, ImageTextureSpec) else []
    return {
        "scene": scene.model_dump(mode="json", exclude={"title"}),
        "files": {name: _sha256(file.path.parent / name) for name in names},
        "made_with": {"variant": variant, **versions()},
        "code": code_digests(),
    }


def _sha256(path: Path) -> str | None:
    try:
        return sha256(path) if path.is_file() else None
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from error


def check_identity(layout: Layout, here: Identity) -> Literal["empty", "same", "smaller"]:
    """Check that the folder is empty or holds a dataset of identity `here`.

    A smaller dataset, with fewer random pushes than `here`, can grow. A damaged identity.json is
    rewritten if the hashes show that it had this content. Raises InputError for a folder that holds
    other files, and for a dataset of another scene, seed, program or machine; the message names the
    first difference.
    """
    path, data = layout.identity, _encoded(here)
    if path.is_file() and path.read_bytes() == data:
        return "same"
    recorded = layout.truth / layout.hashes.name
    table = (parse_hashes(recorded.read_bytes()) if recorded.is_file() else None) or {}
    if table.get(path.name) == digest(data):
        write_bytes(path, data)
        return "same"
    if not path.is_file():
        foreign_file = next(_contents(layout), None)
        if foreign_file is not None:
            raise InputError(
                f"{layout.root}: holds other files ({foreign_file}); choose an empty folder"
            )
        return "empty"
    recorded_identity = read_json(path)
    if _grows(recorded_identity, here):
        return "smaller"
    raise InputError(_refusal(layout, recorded_identity, here))


def _grows(recorded: Identity, here: Identity) -> bool:
    """Test whether a dataset becomes one with identity `here` by adding frames."""
    sizes = {"scene.sampling.count", "scene.pushes.repeats"}
    current = json.loads(json.dumps(here))  # as in the file: tuples become lists
    sampling = current["scene"]["sampling"] or {}
    differences = list(_differences(recorded, current))
    only_size = all(
        key in sizes and isinstance(old, int) and old < new for key, old, new in differences
    )
    return bool(differences) and only_size and sampling.get("method") != "grid"


def write_identity(layout: Layout, identity: Identity) -> str:
    """Write identity.json unless it exists; return its sha256. Raises OSError."""
    data = _encoded(identity)
    layout.truth.mkdir(parents=True, exist_ok=True)
    if not (layout.identity.is_file() and layout.identity.read_bytes() == data):
        write_bytes(layout.identity, data)
    return digest(data)


def _encoded(identity: Identity) -> bytes:
    return (json.dumps(identity) + "\n").encode()


def _contents(layout: Layout) -> Iterator[str]:
    """List files below the root, except those left by an interrupted start of `generate`."""
    leftovers = (layout.lock.name, f".{layout.identity.name}.")
    for path in layout.root.rglob("*") if layout.root.exists() else ():
        if path.is_file() and not path.name.startswith(leftovers):
            yield path.name


def _refusal(layout: Layout, recorded: Identity, current: Identity) -> str:
    remedy = "choose another folder with --out, or delete this one"
    current = json.loads(json.dumps(current))  # as in the file: tuples become lists
    if isinstance(recorded.get("scene"), dict):
        recorded["scene"].pop("title", None)  # older versions had it
    for part in ("scene", "files"):
        if recorded.get(part) != current[part]:
            key, old, new = next(_differences(recorded.get(part), current[part]))
            if key == "sampling.count" and current["scene"]["sampling"]["method"] == "grid":
                remedy = f"a grid cannot grow, method sobol can; {remedy}"
            return (
                f"{layout.root}: holds the dataset of another scene, seed or mesh "
                f"({key or part} is {_short(old)} there and {_short(new)} here); {remedy}"
            )
    readable = "solve, score and report can still read it"
    if "code" in recorded and recorded.get("made_with") != current["made_with"]:
        key, old, new = next(_differences(recorded.get("made_with"), current["made_with"]))
        return (
            f"{layout.root}: was begun with {key or 'packages'} {_short(old)}, here is "
            f"{_short(new)}; {readable}; to generate, {remedy}, or restore the original version"
        )
    changed = sorted({key for key, _, _ in _differences(recorded.get("code"), current["code"])})
    rest = f" and {len(changed) - 1} more modules" if len(changed) > 1 else ""
    return (
        f"{layout.root}: was made by another version of the code ({changed[0] or 'an older one'}"
        f"{rest}); {readable}; to generate, {remedy}, or restore that version"
    )


def _differences(old: Any, new: Any, key: str = "") -> Iterator[tuple[str, Any, Any]]:
    """Yield the dotted keys at which two JSON documents differ, with both values."""
    if isinstance(old, dict) and isinstance(new, dict):
        for name in sorted(old.keys() | new.keys()):
            subkey = f"{key}.{name}".lstrip(".") if isinstance(name, str) else key
            yield from _differences(old.get(name), new.get(name), subkey)
    elif old != new:
        yield key, old, new


def _short(value: Any) -> str:
    text = "nothing" if value is None else str(value)
    return text if len(text) <= 60 else f"{text[:57]}..."
