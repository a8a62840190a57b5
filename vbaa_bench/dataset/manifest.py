"""The truth's manifest: from seed and scene to every byte; and the hashes of both trees."""

import importlib.metadata
import json
import platform
from pathlib import Path
from typing import Any

from solver.instrument.errors import InputError
from solver.instrument.files import sha256, write_text
from solver.instrument.observation import INCOMPLETE
from vbaa_bench.dataset.layout import Layout

_PACKAGES = (
    "vbaa-bench",
    "mitsuba",
    "drjit",
    "numpy",
    "scipy",
    "opencv-contrib-python-headless",
    "OpenEXR",
    "trimesh",
    "polars",
)


def versions() -> dict[str, str]:
    """Versions of Python and of every package that shapes the data."""
    found = {name: importlib.metadata.version(name) for name in _PACKAGES}
    return {"python": platform.python_version(), **found}


def seal(layout: Layout, facts: dict[str, Any]) -> None:
    """Write the manifest and then hashes.json: from here on the dataset counts as complete."""
    manifest = {**facts, "versions": versions(), "hashes": hashes(layout.truth)}
    write_text(layout.manifest, json.dumps(manifest, indent=2) + "\n")
    write_text(layout.hashes, json.dumps(hashes(layout.observations), indent=2) + "\n")
    (layout.observations / INCOMPLETE).unlink(missing_ok=True)


def hashes(tree: Path) -> dict[str, str]:
    """sha256 of every file below `tree`, but for those that are about the tree itself."""
    names = sorted(path.relative_to(tree).as_posix() for path in tree.rglob("*") if path.is_file())
    return {
        name: sha256(tree / name)
        for name in names
        if name not in ("manifest.json", "hashes.json", INCOMPLETE)
    }


def read_json(path: Path) -> dict[str, Any]:
    """The object in a JSON file. Raises InputError if there is none."""
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: cannot be read as JSON ({error})") from error
    if not isinstance(found, dict):
        raise InputError(f"{path}: holds {type(found).__name__}, allowed is a JSON object")
    return found


def verify(tree: Path, recorded: dict[str, Any]) -> None:
    """Compare the files of a tree with their recorded hashes. Raises InputError at the first."""
    found = hashes(tree)
    for name in sorted(recorded.keys() | found.keys()):
        if found.get(name) != recorded.get(name):
            state = "is not what was generated"
            if name not in found:
                state = "is missing"
            elif name not in recorded:
                state = "was not generated"
            raise InputError(f"{tree / name}: {state}; remove the dataset and generate it again")


def verify_observations(layout: Layout) -> None:
    """Raises InputError unless the observations are what was generated."""
    verify(layout.observations, read_json(layout.hashes))


def verify_truth(layout: Layout) -> None:
    """Raises InputError unless the truth is what was generated."""
    recorded = read_json(layout.manifest).get("hashes")
    if not isinstance(recorded, dict):
        raise InputError(f"{layout.manifest}: the key hashes is missing")
    verify(layout.truth, recorded)
