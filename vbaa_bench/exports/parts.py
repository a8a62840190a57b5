"""Parts of an export: frames that are written together, of a bounded size."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import groupby
from operator import itemgetter
from typing import Any, NamedTuple

import polars as pl

from solver.instrument.errors import DamageError
from solver.instrument.hashes import MEND, read_bytes
from vbaa_bench.exports.rig import Rig
from vbaa_bench.exports.source import Source


@dataclass(frozen=True)
class Cut:
    """Rule for cutting a split into parts: limits, and what stays together.

    With `whole_pushes`, frames are ordered by push and step, and a push is never cut: one that is
    larger than the limits is a part of its own.
    """

    most_bytes: int
    most_frames: int = 1_000_000
    whole_pushes: bool = False


class Frame(NamedTuple):
    """One frame: its unique name, rig, row of readings and truth, and the bytes of its PNG."""

    key: str
    rig: Rig
    row: dict[str, Any]
    png: bytes


@dataclass(frozen=True)
class Part:
    """Frames of one split: `number` counts the parts of the split, `index` all parts.

    `first_frame` and `first_push` are the numbers of frames and pushes in the parts before; a push
    is counted in every part that has frames of it. `table` has the schema of the source.
    """

    source: Source
    index: int
    split: str
    number: int
    first_frame: int
    first_push: int
    table: pl.DataFrame

    def frames(self) -> Iterator[Frame]:
        """Read the frames one by one. Raises InputError for a damaged image."""
        for row in self.table.iter_rows(named=True):
            rig = self.source.rigs[row["rig"]]
            image = rig.image_path(row["shard"], row["frame_id"])
            yield Frame(self.source.key(rig.name, row["frame_id"]), rig, row, read_bytes(image))


def parts(source: Source, cut: Cut) -> Iterator[Part]:
    """Cut the frames of all rigs into parts, split by split, in the order of the files.

    The same source and cut give the same parts. Raises InputError.
    """
    index = frames = pushes = 0
    for split in source.splits:
        for number, table in enumerate(_tables(source, split, cut)):
            yield Part(source, index, split, number, frames, pushes, source.rows(table))
            index, frames = index + 1, frames + table.height
            pushes += table.select("rig", "push_id").n_unique()


def _tables(source: Source, split: str, cut: Cut) -> Iterator[pl.DataFrame]:
    """Collect rows of the index, or those of whole pushes, until a limit is reached."""
    pending: list[pl.DataFrame] = []
    size = frames = 0
    chosen = source.index.filter(pl.col("split") == split)
    for (name,), frames_of_rig in chosen.group_by("rig", maintain_order=True):
        table = _in_push_order(frames_of_rig) if cut.whole_pushes else frames_of_rig
        begin = end = 0
        for unit in _units(source.rigs[str(name)], table, cut.whole_pushes):
            too_large = size + unit.size > cut.most_bytes or frames + unit.rows > cut.most_frames
            if frames and too_large:
                yield pl.concat([*pending, table[begin:end]])
                pending, begin, size, frames = [], end, 0, 0
            end, size, frames = end + unit.rows, size + unit.size, frames + unit.rows
        pending.append(table[begin:end])
    if pending:
        yield pl.concat(pending)


class _Unit(NamedTuple):
    """Consecutive rows of a table that stay together, and the bytes of their images."""

    rows: int
    size: int


def _units(rig: Rig, table: pl.DataFrame, whole_pushes: bool) -> Iterator[_Unit]:
    """Yield the pushes, or the frames, of an ordered table. Raises DamageError."""
    frames = table.select("shard", "frame_id", "push_id").iter_rows()
    images = ((rig.image_path(shard, frame_id), push) for shard, frame_id, push in frames)
    for _, unit in groupby(images, key=itemgetter(1 if whole_pushes else 0)):
        try:
            sizes = [path.stat().st_size for path, _ in unit]
        except OSError as error:
            raise DamageError(f"{error.filename}: is missing; {MEND}") from error
        yield _Unit(len(sizes), sum(sizes))


def _in_push_order(table: pl.DataFrame) -> pl.DataFrame:
    """Sort frames by push, in the order of their first frames, then by step."""
    first = pl.col("row").min().over("push_id")
    return table.with_row_index("row").sort(first, "step").drop("row")
