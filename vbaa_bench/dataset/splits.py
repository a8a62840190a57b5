"""Split of each frame: its part of the set, for training or for testing."""

from collections.abc import Collection
from pathlib import Path
from typing import Final

import polars as pl

from solver.instrument.errors import InputError, quoted, truncated
from solver.instrument.hashes import read_bytes
from vbaa_bench.dataset.layout import METADATA, Layout

# Split of all frames whose scene does not state `splits`.
ONLY: Final = "train"


def read_splits(layout: Layout, number: int) -> pl.DataFrame:
    """Read `frame_id` and `split` of the frames of a shard. Raises InputError."""
    path = layout.shard(layout.observations, number) / METADATA
    data = read_bytes(path)
    try:
        frames = pl.read_csv(data, infer_schema=False)
        return frames.select("frame_id", split_names(frames))
    except pl.exceptions.PolarsError as error:
        raise InputError(f"{path}: cannot be read ({truncated(str(error))})") from error


def split_names(frames: pl.DataFrame) -> pl.Series:
    """Return the split of each row of a table of frames, as texts (n,) named "split".

    It is the column `split` of metadata.csv, which `frames` may be, or may be joined with. Where
    the scene does not state `splits`, there is no such column, and all frames are in `ONLY`.
    """
    if "split" not in frames.columns:
        return pl.repeat(ONLY, frames.height, dtype=pl.String, eager=True).alias("split")
    return frames["split"].cast(pl.String).fill_null(ONLY)


def check_split(name: str, existing: Collection[str], root: Path) -> None:
    """Raise InputError, which lists the splits of a dataset, unless `name` is one of them."""
    if name not in existing:
        listed = ", ".join(sorted(existing)) or "none, as it has no frames"
        raise InputError(f"{root}: the split {quoted(name)} does not exist, allowed is {listed}")
