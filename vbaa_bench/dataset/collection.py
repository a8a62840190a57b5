"""Paths of a collection: many random rigs of one scene, each a dataset in the same folder.

COLLECTION/
  collection.json   the scene with its distributions
  rigs.csv          the truth of the rigs: their seeds and drawn values, or why one is impossible
  rig_00000/        a dataset
"""

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from vbaa_bench.dataset.layout import Layout

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

    def rigs(self) -> dict[int, Layout]:
        """Find the complete datasets of the collection, by number."""
        folders = sorted(path for path in self.root.iterdir() if _RIG.fullmatch(path.name))
        layouts = {int(path.name.removeprefix("rig_")): Layout(path) for path in folders}
        return {number: layout for number, layout in layouts.items() if layout.hashes.is_file()}


def is_collection(root: Path) -> bool:
    """Test whether a folder holds a collection."""
    return CollectionLayout(root).scene.is_file()
