"""Reading of a dataset or a collection for an export.

Each rig has one table of readings and truth, joined by frame id. Images are read one by one. Only
files that a hashes.json lists are read, and each must match its sha256.
"""

import re
from collections import OrderedDict
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Final

import polars as pl

from solver.instrument.errors import InputError, printable, quoted
from solver.instrument.hashes import HASHES, digest, read_bytes
from vbaa_bench.dataset.collection import CollectionLayout, is_collection
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.dataset.overall_digest import dataset_digest
from vbaa_bench.dataset.readers import check_complete
from vbaa_bench.exports.columns import CENTRELINE, Schema
from vbaa_bench.exports.rig import INDEX, Rig

# Rows of shards that are kept after they were read. Chosen: 20 MB without centrelines; frames of a
# push are in shards that are near to each other.
_KEPT_ROWS: Final = 20_000


@dataclass(frozen=True)
class Source:
    """Dataset or collection to be exported.

    `index` has one row per frame, in the order of the files: rig, shard, frame_id, split, push_id
    and step. It alone is kept in memory, 0.1 kB per frame. `schema` has the columns of all rigs.
    """

    root: Path
    rigs: Mapping[str, Rig]
    index: pl.DataFrame
    schema: Schema
    collection: bool
    _shards: OrderedDict[tuple[str, int], pl.DataFrame] = field(
        default_factory=OrderedDict, repr=False, compare=False
    )

    @property
    def frames(self) -> int:
        """Number of all frames."""
        return sum(self.splits.values())

    @cached_property
    def splits(self) -> dict[str, int]:
        """Number of frames of each split: the usual splits first, then the others by name."""
        totals = dict(self.index["split"].value_counts().iter_rows())
        usual = [name for name in ("train", "val", "validation", "test") if name in totals]
        return {name: totals[name] for name in (*usual, *sorted(totals.keys() - set(usual)))}

    @property
    def title(self) -> str:
        """Title of the scene, on one line."""
        return " ".join(printable(str(next(iter(self.rigs.values())).stated("title"))).split())

    def rows(self, frames: pl.DataFrame) -> pl.DataFrame:
        """Read all columns of some rows of the index, in their order. Raises InputError."""
        shards = frames.select("rig", "shard").unique(maintain_order=True).iter_rows()
        table = pl.concat([self._shard(rig, number) for rig, number in shards])
        labelled = frames.select("rig", "frame_id").join(
            table, on=["rig", "frame_id"], how="inner", maintain_order="left"
        )
        return self.schema.applied(labelled)

    def _shard(self, rig: str, number: int) -> pl.DataFrame:
        """Read the frames of a shard; the last shards are kept."""
        if (rig, number) not in self._shards:
            centrelines = any(name.startswith(CENTRELINE) for name in self.schema.types)
            table = self.rigs[rig].frames(number, centrelines=centrelines)
            self._shards[rig, number] = self.schema.applied(table)
            while len(self._shards) > 1 and self._kept() > _KEPT_ROWS:
                self._shards.popitem(last=False)
        return self._shards[rig, number]

    def _kept(self) -> int:
        return sum(table.height for table in self._shards.values())

    def key(self, rig: str, frame_id: str) -> str:
        """Return the name of a frame that is unique in all rigs."""
        return f"{rig}_{frame_id}" if self.collection else frame_id

    @cached_property
    def digest(self) -> str:
        """Digest of the dataset or collection. Raises InputError."""
        return dataset_digest(self.root)

    def identity(self) -> list[str]:
        """Compute digests that change with any file of any rig. Raises InputError."""
        trees = [tree for rig in self.rigs.values() for tree in rig.layout.trees]
        return [digest(read_bytes(tree / HASHES)) for tree in trees]


# Shards between two messages of progress.
_BATCH: Final = 256
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
    places = [(rig, number) for rig in rigs.values() for number in rig.shards()]
    index, columns = [], pl.DataFrame()
    for done, (rig, number) in enumerate(places, start=1):
        table = rig.frames(number)
        if table.height:
            columns = _merged(root, columns, table.clear())
            index.append(table.select(INDEX))
        if done % _BATCH == 0:  # many small tables take more memory than one
            index = [pl.concat(index, rechunk=True)]
            progress(done, len(places))
    if not index:
        raise InputError(f"{root}: holds no frames")
    frames = pl.concat(index, rechunk=True)
    _check_splits(root, frames["split"])
    names = frames.select("rig", "frame_id")
    if (twice := names.filter(names.is_duplicated())).height:
        raise InputError(f"{root}: the frame {quoted(twice['frame_id'][0])} is in two shards")
    schema = Schema(dict(columns.schema)).with_usual_types().with_centrelines(centrelines)
    return Source(root, rigs, frames, schema, collection)


def _merged(root: Path, one: pl.DataFrame, other: pl.DataFrame) -> pl.DataFrame:
    """Merge the columns of two tables: of whole and real numbers, and of numbers and texts, too."""
    try:
        return pl.concat([one, other], how="diagonal_relaxed")
    except pl.exceptions.SchemaError as error:
        raise InputError(f"{root}: a column has several types ({error})") from error


def _check_splits(root: Path, splits: pl.Series) -> None:
    for name in splits.unique():
        if not _SPLIT.fullmatch(str(name)):
            raise InputError(
                f"{root}: a split has the name {quoted(name)}, "
                "allowed are letters, digits and _, at most 64"
            )
