"""Paths of a collection: many random rigs of one scene, each a dataset in the same folder.

COLLECTION/
  collection.json   the scene with its distributions
  rigs.csv          the truth of the rigs: their seeds and drawn values, or why one is impossible
  rig_00000/        a dataset
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final, NamedTuple

import polars as pl

from solver.instrument.files import write_bytes
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.dataset.manifest import read_json

_RIG: Final = re.compile(r"rig_\d{5,}")


@dataclass(frozen=True)
class CollectionLayout:
    """The paths of the collection at `root`."""

    root: Path

    @property
    def scene(self) -> Path:
        """The file that identifies the collection's scene."""
        return self.root / "collection.json"

    @property
    def table(self) -> Path:
        """The table of the rigs and their drawn values."""
        return self.root / "rigs.csv"

    def rig(self, number: int) -> Layout:
        """Return the layout of one rig's dataset."""
        return Layout(self.root / f"rig_{number:05d}")

    def write_rows(self, rows: Mapping[int, Mapping[str, str | None]]) -> None:
        """Write the table of the rigs, by number. Raises OSError."""
        # Rigs whose sections differ have different columns; all are texts, as some have both.
        columns = dict.fromkeys(name for number in sorted(rows) for name in rows[number])
        table = pl.DataFrame(
            [rows[number] for number in sorted(rows)], schema=dict.fromkeys(columns, pl.String)
        )
        write_bytes(self.table, table.write_csv().encode())

    def rigs(self) -> dict[int, Layout]:
        """Find the complete datasets of the collection, by number."""
        folders = sorted(path for path in self.root.iterdir() if _RIG.fullmatch(path.name))
        layouts = {int(path.name.removeprefix("rig_")): Layout(path) for path in folders}
        return {number: layout for number, layout in layouts.items() if layout.hashes.is_file()}


class FrameCounts(NamedTuple):
    """Numbers of frames that were rendered, of those that failed, and of impossible rigs."""

    frames: int
    failed_frames: int
    failed_rigs: int = 0

    @property
    def complete(self) -> bool:
        """Whether nothing failed."""
        return not self.failed_frames and not self.failed_rigs


def count_frames(root: Path) -> FrameCounts:
    """Count the frames of a dataset or of a collection, from its manifests. Raises InputError."""
    if not is_collection(root):
        facts = read_json(Layout(root).manifest)
        return FrameCounts(facts["frames"], facts["failed_frames"])
    collection = CollectionLayout(root)
    rigs = [count_frames(layout.root) for layout in collection.rigs().values()]
    reasons = pl.read_csv(collection.table, infer_schema=False)["reason"]
    return FrameCounts(
        sum(rig.frames for rig in rigs),
        sum(rig.failed_frames for rig in rigs),
        reasons.len() - reasons.null_count(),
    )


def is_collection(root: Path) -> bool:
    """Test whether a folder holds a collection."""
    return CollectionLayout(root).scene.is_file()
