"""Hugging Face dataset: Parquet files with embedded images, labels joined, and a card.

OUT/
  README.md                             dataset card, whose front matter states the files of splits
  data/<split>-00000-of-00002.parquet   one row per frame: image, readings and labels
  croissant.json, croissant_task.json   metadata, see croissant.py
"""

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import ClassVar, Final

import polars as pl

from solver.instrument.files import move_into_place
from vbaa_bench.exports.columns import SHARD
from vbaa_bench.exports.croissant import document_errors, write_exported
from vbaa_bench.exports.format import Exported, Format
from vbaa_bench.exports.output import Record
from vbaa_bench.exports.parquet import GROUP_ROWS, features, image_column, write_parquet
from vbaa_bench.exports.parts import Cut, Part
from vbaa_bench.exports.source import Source

# Chosen: a file is built in memory, which takes four times this; the library writes 500 MB.
_FILE_BYTES: Final = 128_000_000
_FRONT: Final = """\
---
pretty_name: {title}
license: cc-by-4.0
task_categories:
- other
- image-feature-extraction
tags:
- robotics
- tactile-sensing
- active-antenna
- synthetic
- croissant
size_categories:
- {size}
configs:
- config_name: default
  data_files:
{files}
---

"""
_SIZES: Final = {
    "n<1K": 1e3,
    "1K<n<10K": 1e4,
    "10K<n<100K": 1e5,
    "100K<n<1M": 1e6,
    "1M<n<10M": 1e7,
}


class HuggingFace(Format):
    """Parquet files of bounded size."""

    usual_cut: ClassVar = Cut(_FILE_BYTES)
    layout: ClassVar = """\
- `data/<split>-00000-of-00001.parquet`: one row per frame with `image`, readings and labels.
- `croissant.json`: the same in Croissant 1.1; `croissant_task.json`: the benchmark as a task."""
    loading: ClassVar = """\
from datasets import load_dataset

frames = load_dataset("OUT", split="{split}")  # the folder of this card
image, x_c_mm = frames[0]["image"], frames[0]["x_c_mm"]
"""

    def write_part(self, folder: Path, part: Part) -> Record:
        """Write one Parquet file; the number of all files is not known yet."""
        images = [(f"{frame.key}.png", frame.png) for frame in part.frames()]
        table = part.table.drop(SHARD).insert_column(0, image_column("image", images))
        path = folder / "data" / f"{part.split}-{part.number:05d}.parquet"
        write_parquet(path, table, {"huggingface": features(table.schema)})
        return {"split": part.split}

    def finish(self, folder: Path, source: Source, records: Sequence[Record]) -> None:
        """Rename the files, now that their number is known."""
        for split in source.splits:
            count = sum(record["split"] == split for record in records)
            for number in range(count):
                path = folder / "data" / f"{split}-{number:05d}.parquet"
                if path.exists():
                    move_into_place(path, path.with_stem(f"{path.stem}-of-{count:05d}"))
        write_exported(folder, source)

    def read_back(self, folder: Path, source: Source) -> Iterator[Exported]:
        """Read the Parquet files row group by row group, in the order of their names."""
        for split in source.splits:
            for path in sorted((folder / "data").glob(f"{split}-*-of-*.parquet")):
                lazy = pl.scan_parquet(path)
                for batch in lazy.collect_batches(chunk_size=GROUP_ROWS, maintain_order=True):
                    for row in batch.iter_rows(named=True):
                        image = row.pop("image")
                        yield Exported(Path(image["path"]).stem, split, image["bytes"], row)

    def structure_errors(self, folder: Path, source: Source) -> Iterator[str]:
        """Compare croissant.json with the files."""
        yield from document_errors(folder, source)

    def front_matter(self, source: Source) -> str:
        """State licence, size and the files of every split, in YAML."""
        files = "\n".join(
            f'  - split: "{split}"\n    path: "data/{split}-*.parquet"' for split in source.splits
        )
        title = json.dumps(source.title, ensure_ascii=False)  # which is YAML, too
        size = next((name for name, most in _SIZES.items() if source.frames < most), "10M<n<100M")
        return _FRONT.format(title=title, size=size, files=files)
