"""Reading of a dataset or a collection for an export.

Each rig has one table of readings and truth, joined by frame id. Images are read one by one. Only
files that a hashes.json lists are read, and each must match its sha256.
"""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property, partial
from pathlib import Path
from typing import Final

import polars as pl

from solver.instrument.errors import InputError, quoted
from solver.instrument.hashes import HASHES, digest, read_bytes
from vbaa_bench.dataset.collection import CollectionLayout, is_collection
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.dataset.readers import check_complete
from vbaa_bench.exports.columns import Schema, merged_schema
from vbaa_bench.exports.rig import Rig


@dataclass(frozen=True)
class Source:
    """Dataset or collection to be exported.

    `counts` are the frames of each rig by split. `schema` has the columns of all rigs.
    """

    root: Path
    rigs: Mapping[str, Rig]
    counts: Mapping[str, Mapping[str, int]]
    schema: Schema
    collection: bool
    # The table of one rig, which is needed for every split and again for the check.
    _read: dict[str, pl.DataFrame] = field(default_factory=dict, repr=False, compare=False)

    @property
    def frames(self) -> int:
        """Number of all frames."""
        return sum(self.splits.values())

    @cached_property
    def splits(self) -> dict[str, int]:
        """Number of frames of each split: the usual splits first, then the others by name."""
        totals: dict[str, int] = {}
        for counts in self.counts.values():
            for split, count in counts.items():
                totals[split] = totals.get(split, 0) + count
        usual = [name for name in ("train", "val", "validation", "test") if name in totals]
        return {name: totals[name] for name in (*usual, *sorted(totals.keys() - set(usual)))}

    @property
    def title(self) -> str:
        """Title of the scene."""
        return str(next(iter(self.rigs.values())).scene.get("title") or self.root.name)

    def table(self, name: str) -> pl.DataFrame:
        """Read the table of a rig, with the columns of all rigs. Raises InputError."""
        if name not in self._read:
            self._read.clear()
            self._read[name] = self.rigs[name].table()
        return self.schema.applied(self._read[name])

    def key(self, rig: str, frame_id: str) -> str:
        """Return the name of a frame that is unique in all rigs."""
        return f"{rig}_{frame_id}" if self.collection else frame_id

    def identity(self) -> list[str]:
        """Compute digests that change with any file of any rig. Raises InputError."""
        trees = [tree for rig in self.rigs.values() for tree in rig.layout.trees]
        return [digest(read_bytes(tree / HASHES)) for tree in trees]


# A name of a split is a part of file names, and Hugging Face allows no others.
_SPLIT: Final = re.compile(r"\w{1,64}")


def open_source(
    root: Path,
    *,
    centrelines: bool = False,
    progress: Callable[[int, int], None] = lambda _done, _total: None,
) -> Source:
    """Open a dataset or a collection, and read the tables of all its rigs once.

    With `centrelines`, the schema has their columns. `progress` receives the number of shards that
    were read, now and then, and of all. Raises InputError if the folder is missing,
    incomplete or damaged.
    """
    if collection := is_collection(root):
        layouts = CollectionLayout(root).rigs().values()
        rigs = {layout.root.name: Rig(layout.root.name, layout) for layout in layouts}
        if not rigs:
            raise InputError(f"{root}: holds no complete rig")
    else:
        check_complete(Layout(root))
        rigs = {"rig": Rig("rig", Layout(root))}
    counts, schemas = {}, []
    shards = {name: len(rig.shards()) for name, rig in rigs.items()}
    total, before = sum(shards.values()), 0
    for name, rig in rigs.items():
        table = rig.table(partial(_tick, progress, before, total))
        before += shards[name]
        _check_splits(rig, table["split"])
        counts[name] = dict(table["split"].value_counts().iter_rows())
        schemas.append(table.schema)
    schema = merged_schema(schemas)
    schema = schema.with_centrelines(centrelines)
    return Source(root, rigs, counts, schema, collection, {name: table})


def _tick(progress: Callable[[int, int], None], before: int, total: int, done: int) -> None:
    progress(before + done, total)


def _check_splits(rig: Rig, splits: pl.Series) -> None:
    for name in splits.unique():
        if not _SPLIT.fullmatch(str(name)):
            raise InputError(
                f"{rig.layout.root}: a split has the name {quoted(name)}, "
                "allowed are letters, digits and _, at most 64"
            )
