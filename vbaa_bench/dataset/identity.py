"""Identity of a dataset: its scene and the program that makes it. `generate` rejects mismatches."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from solver.instrument.errors import InputError
from solver.instrument.files import sha256, write_bytes
from solver.instrument.hashes import digest, parse_hashes
from vbaa_bench.dataset.code import code_digests
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.dataset.manifest import read_json, versions
from vbaa_bench.scene.load import SceneFile
from vbaa_bench.scene.objects import MeshSpec

Identity = dict[str, Any]


def identity_of(file: SceneFile, variant: str) -> Identity:
    """Collect everything that the bytes of a dataset depend on, without the scene's title."""
    scene = file.scene
    names = [scene.object.file] if isinstance(scene.object, MeshSpec) else []
    names += [light.file for light in scene.lights if light.kind == "environment" and light.file]
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


def check_identity(layout: Layout, here: Identity) -> bool:
    """Check that the folder holds a dataset of identity `here`; return False if it is empty.

    A damaged identity.json is rewritten if the hashes show that it had this content. Raises
    InputError for a folder that holds something else, and for a dataset of another scene, seed,
    program or machine; the message names the first difference.
    """
    path, data = layout.identity, _encoded(here)
    if path.is_file() and path.read_bytes() == data:
        return True
    recorded = layout.truth / layout.hashes.name
    table = (parse_hashes(recorded.read_bytes()) if recorded.is_file() else None) or {}
    if table.get(path.name) == digest(data):
        write_bytes(path, data)
        return True
    if not path.is_file():
        other = next(_contents(layout), None)
        if other is not None:
            raise InputError(
                f"{layout.root}: holds something else ({other}); choose an empty folder"
            )
        return False
    raise InputError(_refusal(layout, read_json(path), here))


def write_identity(layout: Layout, identity: Identity) -> str:
    """Write identity.json unless it exists; return its sha256. Raises OSError."""
    data = _encoded(identity)
    layout.truth.mkdir(parents=True, exist_ok=True)
    if not layout.identity.is_file():
        write_bytes(layout.identity, data)
    return digest(data)


def _encoded(identity: Identity) -> bytes:
    return (json.dumps(identity) + "\n").encode()


def _contents(layout: Layout) -> Iterator[str]:
    """List files below the root, except those left by an interrupted start of `generate`."""
    left = (layout.lock.name, f".{layout.identity.name}.")
    for path in layout.root.rglob("*") if layout.root.exists() else ():
        if path.is_file() and not path.name.startswith(left):
            yield path.name


def _refusal(layout: Layout, there: Identity, here: Identity) -> str:
    mend = "choose another folder with --out, or remove it"
    here = json.loads(json.dumps(here))  # as in the file: tuples become lists
    if isinstance(there.get("scene"), dict):
        there["scene"].pop("title", None)  # older versions had it
    for part in ("scene", "files"):
        if there.get(part) != here[part]:
            key, was, now = next(_differences(there.get(part), here[part]))
            return (
                f"{layout.root}: holds the dataset of another scene, seed or mesh "
                f"({key or part} is {_short(was)} there and {_short(now)} here); {mend}"
            )
    readable = "solve, score and report read it as it is"
    if "code" in there and there.get("made_with") != here["made_with"]:
        key, was, now = next(_differences(there.get("made_with"), here["made_with"]))
        return (
            f"{layout.root}: was begun with {key or 'packages'} {_short(was)}, here is "
            f"{_short(now)}; {readable}; to generate, {mend}, or go back to what it was begun with"
        )
    changed = sorted({key for key, _, _ in _differences(there.get("code"), here["code"])})
    more = f" and {len(changed) - 1} more modules" if len(changed) > 1 else ""
    return (
        f"{layout.root}: was made by another version of the code ({changed[0] or 'an older one'}"
        f"{more}); {readable}; to generate, {mend}, or go back to that version"
    )


def _differences(there: Any, here: Any, key: str = "") -> Iterator[tuple[str, Any, Any]]:
    """Yield the dotted keys at which two JSON documents differ, with both values."""
    if isinstance(there, dict) and isinstance(here, dict):
        for name in sorted(there.keys() | here.keys()):
            below = f"{key}.{name}".lstrip(".") if isinstance(name, str) else key
            yield from _differences(there.get(name), here.get(name), below)
    elif there != here:
        yield key, there, here


def _short(value: Any) -> str:
    text = "nothing" if value is None else str(value)
    return text if len(text) <= 60 else f"{text[:57]}..."
