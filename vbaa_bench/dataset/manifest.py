"""The truth's manifest, the versions of packages, and the step that completes a dataset."""

import importlib.metadata
import json
import platform
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from solver.instrument.errors import InputError
from solver.instrument.files import holds, sync_folder, write_bytes
from solver.instrument.hashes import HASHES, digest, hashes_bytes, read_bytes
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.dataset.schema import SCHEMA

# Largest JSON document [bytes]. Chosen: ten times a baseline of 100,000 frames.
_MAX_JSON_BYTES: Final = 1 << 28
_PACKAGES = (
    "mitsuba",
    "drjit",
    "numpy",
    "numba",
    "scipy",
    "opencv-contrib-python-headless",
    "OpenEXR",
    "trimesh",
    "polars",
)


def versions() -> dict[str, str]:
    """Collect the versions of Python and of every package that shapes the data."""
    python = ".".join(platform.python_version_tuple()[:2])
    return {"python": python, **{name: importlib.metadata.version(name) for name in _PACKAGES}}


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


def read_json(path: Path) -> dict[str, Any]:
    """Read the object in a JSON file. Raises InputError if there is none, or it is too large."""
    try:
        document = json.loads(read_bytes(path, _MAX_JSON_BYTES))
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}: cannot be read as JSON ({error})") from error
    if not isinstance(document, dict):
        raise InputError(f"{path}: holds {type(document).__name__}, allowed is a JSON object")
    return document
