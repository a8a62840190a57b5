"""Paths of a collection: many random rigs of one scene, each a dataset in the same folder.

COLLECTION/
  collection.json   the scene with its distributions
  rigs.csv          the truth of the rigs: their seeds and drawn values, or why one is impossible
  hashes.json       sha256 of these files
  rig_00000/        a dataset
"""

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, NamedTuple

import polars as pl

from solver.instrument.errors import DamageError, InputError
from solver.instrument.hashes import MEND, digest, read_bytes, read_hashes
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.dataset.manifest import read_json
from vbaa_bench.dataset.recorded import exists, write_recorded

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

    def write_scene(self, scene: Mapping[str, Any]) -> None:
        """Write the collection's scene, as keys and values with distributions. Raises OSError."""
        write_recorded(self.root, {self.scene.name: _encoded(scene)})

    def held_scene(self, scene: Mapping[str, Any]) -> bool:
        """Test whether collection.json had this scene when it was written, whatever it holds now.

        Raises InputError.
        """
        recorded = (read_hashes(self.root) or {}).get(self.scene.name)
        return recorded == digest(_encoded(scene))

    def write_rows(self, rows: Mapping[int, Mapping[str, str | None]]) -> None:
        """Write the table of the rigs, by number. Raises OSError."""
        # Rigs whose sections differ have different columns; all are texts, as some have both.
        columns = dict.fromkeys(name for number in sorted(rows) for name in rows[number])
        table = pl.DataFrame(
            [rows[number] for number in sorted(rows)], schema=dict.fromkeys(columns, pl.String)
        )
        write_recorded(self.root, {self.table.name: table.write_csv().encode()})

    def read_rows(self) -> dict[int, dict[str, str | None]]:
        """Read the table of the rigs, by number; empty if there is none. Raises InputError."""
        if not exists(self.table):
            return {}
        try:
            rows = pl.read_csv(read_bytes(self.table), infer_schema=False).to_dicts()
            return {int(row["rig"]): row for row in rows}
        except (pl.exceptions.PolarsError, KeyError, TypeError, ValueError) as error:
            raise InputError(f"{self.table}: is not a table of rigs ({error})") from error

    def folders(self) -> dict[int, Layout]:
        """Find the folders of rigs, complete or not, by number."""
        names = sorted(path.name for path in self.root.iterdir() if _RIG.fullmatch(path.name))
        return {int(name.removeprefix("rig_")): Layout(self.root / name) for name in names}

    def rigs(self) -> dict[int, Layout]:
        """Find the complete datasets of the collection, by number.

        Raises DamageError if rigs.csv lists a rig that is missing or incomplete.
        """
        layouts = {n: layout for n, layout in self.folders().items() if layout.hashes.is_file()}
        for number, row in self.read_rows().items():
            if not row.get("reason") and number not in layouts:
                raise DamageError(f"{self.rig(number).root}: is missing or incomplete; {MEND}")
        return layouts


def _encoded(scene: Mapping[str, Any]) -> bytes:
    return (json.dumps(scene, indent=2) + "\n").encode()


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
    return FrameCounts(
        sum(rig.frames for rig in rigs),
        sum(rig.failed_frames for rig in rigs),
        sum(bool(row["reason"]) for row in collection.read_rows().values()),
    )


def is_collection(root: Path) -> bool:
    """Test whether a folder holds a collection, perhaps a damaged one."""
    layout = CollectionLayout(root)
    return layout.scene.is_file() or layout.table.is_file()
