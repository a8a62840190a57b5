"""The truth's manifest: from seed and scene to every byte; and the hashes of both trees."""

import importlib.metadata
import json
import platform
from pathlib import Path
from typing import Any

from solver.instrument.files import sha256, write_text
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


def hashes(tree: Path) -> dict[str, str | None]:
    """sha256 of every file below `tree`, but for the manifest and the hashes themselves."""
    names = sorted(path.relative_to(tree).as_posix() for path in tree.rglob("*") if path.is_file())
    return {
        name: sha256(tree / name) for name in names if name not in ("manifest.json", "hashes.json")
    }
