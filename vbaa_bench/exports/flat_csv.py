"""Flat table: one CSV file of readings and labels, and the images in folders.

OUT/
  metadata.csv                   one row per frame; `file_name` is the path of its image
  images/train-000000/<frame>.png
"""

import csv
import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, ClassVar, Final

import polars as pl

from solver.instrument.files import write_bytes
from vbaa_bench.exports.columns import SHARD, VECTORS
from vbaa_bench.exports.format import Exported, Format
from vbaa_bench.exports.output import Record
from vbaa_bench.exports.parts import Cut, Part, parts
from vbaa_bench.exports.source import Source

_TABLE: Final = "metadata.csv"
# Images per folder. Chosen: file managers are slow with more.
_FOLDER_FRAMES: Final = 1000


class FlatCsv(Format):
    """A table and images. A vector has three columns; a longer list is JSON in one cell."""

    usual_cut: ClassVar = Cut(10**12, most_frames=_FOLDER_FRAMES)
    layout: ClassVar = """\
- `metadata.csv`: one row per frame; `file_name` is the path of its image. A vector has the columns
  `<name>_x`, `<name>_y` and `<name>_z`; a longer list is JSON in one cell.
- `images/`: at most 1,000 images per folder."""
    loading: ClassVar = """\
import pandas as pd
from PIL import Image

frames = pd.read_csv("metadata.csv")
image = Image.open(frames.file_name[0])
"""

    def write_part(self, folder: Path, part: Part) -> Record:
        """Write one folder of images."""
        images = folder / "images" / _name(part)
        images.mkdir(parents=True, exist_ok=True)
        for frame in part.frames():
            write_bytes(images / f"{frame.key}.png", frame.png)
        return {}

    def finish(self, folder: Path, source: Source, _records: Sequence[Record]) -> None:
        """Write the table, part by part."""
        path = folder / _TABLE
        with path.open("wb") as stream:
            for part in parts(source, self.cut):
                stream.write(_flat(part).write_csv(include_header=part.index == 0).encode())

    def read_back(self, folder: Path, source: Source) -> Iterator[Exported]:
        """Read the table row by row, and each image from the path in its row."""
        with (folder / _TABLE).open(encoding="utf-8", newline="") as stream:
            for row in csv.DictReader(stream):
                path = folder / row["file_name"]
                values = {
                    name: _value(row, name, dtype) for name, dtype in source.schema.exported.items()
                }
                yield Exported(path.stem, row["split"], path.read_bytes(), values)


def _name(part: Part) -> str:
    return f"{part.split}-{part.number:06d}"


def _flat(part: Part) -> pl.DataFrame:
    """Return the rows of a part without nested columns."""
    table = part.table.drop(SHARD)
    columns: list[pl.Expr | pl.Series] = []
    for name, dtype in table.schema.items():
        if name in VECTORS:
            columns += [pl.col(name).list.get(i).alias(f"{name}_{x}") for i, x in enumerate("xyz")]
        elif isinstance(dtype, pl.List):
            texts = [None if cell is None else json.dumps(cell.to_list()) for cell in table[name]]
            columns.append(pl.Series(name, texts, dtype=pl.String))
        else:
            columns.append(pl.col(name))
    keys = [part.source.key(*names) for names in table.select("rig", "frame_id").iter_rows()]
    images = pl.Series("file_name", [f"images/{_name(part)}/{key}.png" for key in keys])
    return table.select(images, *columns)


def _value(row: dict[str, str], name: str, dtype: pl.DataType) -> Any:
    """Parse a cell, or the three cells of a vector, by the type of its column."""
    if name in VECTORS:
        return [float(row[f"{name}_{x}"]) for x in "xyz"] if row[f"{name}_x"] else None
    text = row[name]
    if not text or dtype == pl.String():
        return text
    if isinstance(dtype, pl.List):
        return json.loads(text)
    return text == "true" if dtype == pl.Boolean() else float(text)
