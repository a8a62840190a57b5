"""Readers of the truth."""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
import polars as pl

from solver.instrument.camera import Camera
from solver.instrument.errors import InputError, quoted, truncated
from solver.instrument.hashes import HASHES, listed, read_bytes
from vbaa_bench.dataset.dataset_columns import CENTRELINE, TRUTH_SCHEMA
from vbaa_bench.dataset.document import read_json
from vbaa_bench.dataset.format_version import SCHEMA, migrated_frames, migrated_manifest, version_of
from vbaa_bench.dataset.layout import TRUTH_TABLE, Layout
from vbaa_bench.dataset.manifest import checked_manifest, true_camera
from vbaa_bench.dataset.tables import check_unique, checked, read_parquet

# Threads that read shards. Chosen: more are not faster, and each holds one shard in memory.
_THREADS: Final = 4


@dataclass(frozen=True)
class Truth:
    """An opened truth tree: the manifest and one row per frame, sorted by frame id.

    `version` is that of the format of its files; manifest and frames are of the current one.
    """

    root: Path
    manifest: dict[str, Any]
    frames: pl.DataFrame
    version: int = SCHEMA

    @property
    def camera(self) -> Camera:
        """The true camera, with which the frames were rendered."""
        return true_camera(self.manifest)


def check_complete(layout: Layout) -> None:
    """Raise InputError unless the dataset is complete: its observations/hashes.json exists."""
    try:
        complete, begun = layout.hashes.is_file(), layout.identity.is_file()
    except OSError as error:
        raise InputError(f"{layout.root}: cannot be read ({error.strerror})") from error
    if complete:
        return
    if begun:
        raise InputError(
            f"{layout.root}: is incomplete; run the command that generates it again to finish it"
        )
    raise InputError(f"{layout.root}: is not a dataset, observations/{HASHES} is missing")


def open_manifest(root: Path | str) -> Truth:
    """Open the truth tree of a dataset at `root` without its frames, of which the result has none.

    Raises InputError if the manifest is missing or damaged, or the dataset incomplete.
    """
    root = Path(root)
    check_complete(Layout(root.parent))
    path = root / "manifest.json"
    document = read_json(path)
    manifest = checked_manifest(path, migrated_manifest(path, document))
    return Truth(root, manifest, pl.DataFrame(), version_of(path, document))


def open_truth(root: Path | str, *, centrelines: bool = True) -> Truth:
    """Open the truth tree of a dataset at `root`; its observations are beside it.

    Without `centrelines`, the columns `centreline_*` are left out: they take 99 % of the memory.
    Only files listed in its hashes.json are read, and they must match their hashes. Raises
    InputError if the tree is missing, damaged or incomplete.
    """
    root = Path(root)
    opened = open_manifest(root)
    names = listed(root)
    tables = [
        table
        for table in sorted(root.glob(f"shard_*/{TRUTH_TABLE}"))
        if names is None or table.relative_to(root).as_posix() in names
    ]
    if not tables:
        raise InputError(f"{root}: holds no shard_*/{TRUTH_TABLE}")
    try:
        # A column that is null in a whole shard has no type there, and random sections differ.
        # Threads: hashing and unpacking happen outside of Python's lock.
        with ThreadPoolExecutor(_THREADS) as threads:
            shards = list(threads.map(lambda table: _table(table, centrelines), tables))
        frames = pl.concat(shards, how="diagonal_relaxed").sort("frame_id")
    except (pl.exceptions.PolarsError, OSError) as error:
        reason = truncated(str(error))
        raise InputError(f"{root}: a {TRUTH_TABLE} cannot be read ({reason})") from error
    return replace(opened, frames=_checked(frames, opened.version, root))


def read_shard(truth: Truth, number: int, *, centrelines: bool = True) -> pl.DataFrame:
    """Read the frames of one shard of an opened truth; no rows or columns if all have failed.

    Without `centrelines`, the columns `centreline_*` are left out. Raises InputError if the shard
    is missing or damaged.
    """
    path = Layout(truth.root.parent).shard(truth.root, number) / TRUTH_TABLE
    table = _table(path, centrelines)
    return _checked(table, truth.version, path) if table.height else pl.DataFrame()


def _checked(frames: pl.DataFrame, version: int, source: Path) -> pl.DataFrame:
    """Migrate frames of a version, and check their columns and names. Raises InputError."""
    frames = checked(migrated_frames(frames, version), TRUTH_SCHEMA, str(source))
    check_unique(frames, "frame_id", str(source))
    return frames


def read_frame(shard: Path, frame_id: str) -> dict[str, Any]:
    """Read the row of one frame, with its centreline, from a shard of the truth tree.

    Raises InputError if the shard cannot be read.
    """
    rows = read_rows(shard, [frame_id])
    if len(rows) != 1:
        raise InputError(
            f"{shard / TRUTH_TABLE}: has {len(rows)} rows of frame {quoted(frame_id)}, allowed "
            "is one"
        )
    return rows[0]


def read_rows(shard: Path, frame_ids: Sequence[str]) -> list[dict[str, Any]]:
    """Read the rows of frames, with their centrelines, from a shard of the truth tree.

    Raises InputError if the shard cannot be read.
    """
    path = shard / TRUTH_TABLE
    table = checked(_table(path, centrelines=True), TRUTH_SCHEMA, str(path))
    rows = table.filter(pl.col("frame_id").is_in(frame_ids)).to_dicts()
    for row in rows:
        lines = [np.array(row.get(axis) or (), dtype=float) for axis in CENTRELINE]
        sizes = {line.size for line in lines}
        if len(sizes) != 1 or sizes == {0} or not np.isfinite(lines).all():
            raise InputError(f"{path}: the centreline of a frame is missing, or is not finite")
    return rows


def _table(path: Path, centrelines: bool) -> pl.DataFrame:
    left_out = () if centrelines else ("centreline_",)
    return read_parquet(
        path, read_bytes(path), lambda name: not name.startswith(left_out), schema=TRUTH_SCHEMA
    )
