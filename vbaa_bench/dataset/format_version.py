"""Version of the dataset format, and the migration of older versions.

`truth/identity.json` and `truth/manifest.json` state the version as `schema`, a whole number. It
is incremented with every change after which an older reader would fail or misread: a file, key or
column that is removed, renamed, newly required, or has another unit or meaning. A new optional
column does not change it.

A reader accepts its own version. It migrates older ones in memory, step by step from version k to
k + 1, and never changes the files. It refuses newer ones. Only datasets of the current version can
be completed or grown.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any, Final, NamedTuple

import polars as pl

from solver.instrument.errors import InputError, quoted

Document = dict[str, Any]


class Step(NamedTuple):
    """Migration from one version to the next: of the identity, the manifest and the truth table."""

    changes: str
    identity: Callable[[Document], Document]
    manifest: Callable[[Document], Document]
    frames: Callable[[pl.DataFrame], pl.DataFrame]


def _identity_from_1_to_2(old: Document) -> Document:
    scene = old.get("scene")
    if not isinstance(scene, dict):
        return old
    return {**old, "scene": {name: value for name, value in scene.items() if name != "title"}}


def _manifest_from_1_to_2(old: Document) -> Document:
    # A frame that failed ended the run, so that complete datasets had none.
    return {**old, "frames": None, "failed_frames": 0}


def _frames_from_1_to_2(old: pl.DataFrame) -> pl.DataFrame:
    return old.with_columns(processor=pl.lit(None, pl.String))


# The step at index k - 1 migrates from version k, the first of which did not state it.
STEPS: Final = (
    Step(
        "The version is stated as `schema`. The identity's scene has no title. The manifest counts "
        "`frames`, null in migrated datasets, and `failed_frames`. The truth of a frame names the "
        "kind of `processor` that computed it, null in migrated datasets.",
        _identity_from_1_to_2,
        _manifest_from_1_to_2,
        _frames_from_1_to_2,
    ),
)
SCHEMA: Final = len(STEPS) + 1


def version_of(path: Path, document: Document) -> int:
    """Return the version of an identity or manifest read from `path`; 1 if it states none.

    Raises InputError for a version that this program cannot read.
    """
    version = document.get("schema", 1)
    if not isinstance(version, int) or isinstance(version, bool) or version < 1:
        raise InputError(f"{path}: schema is {quoted(version)}, allowed is a whole number")
    if version > SCHEMA:
        raise InputError(
            f"{path}: has version {version} of the format, this program reads versions 1 to "
            f"{SCHEMA}; install a newer vbaa-bench"
        )
    return version


def migrated_identity(path: Path, document: Document) -> Document:
    """Convert an identity to the current version. Raises InputError."""
    for step in STEPS[version_of(path, document) - 1 :]:
        document = step.identity(document)
    return {**document, "schema": SCHEMA}


def migrated_manifest(path: Path, document: Document) -> Document:
    """Convert a manifest to the current version. Raises InputError."""
    for step in STEPS[version_of(path, document) - 1 :]:
        document = step.manifest(document)
    return {**document, "schema": SCHEMA}


def migrated_frames(frames: pl.DataFrame, version: int) -> pl.DataFrame:
    """Convert a truth table of a version to the current version."""
    for step in STEPS[version - 1 :]:
        frames = step.frames(frames)
    return frames
