"""Writer of shards: written to a temporary folder, then moved into place with their hashes."""

import csv
import io
import json
import shutil
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
import polars as pl

from solver.instrument.arrays import Grey
from solver.instrument.files import sync_folder, write_bytes
from solver.instrument.hashes import HASHES, digest
from solver.instrument.images import png_bytes
from vbaa_bench.dataset.exr import exr_bytes
from vbaa_bench.dataset.layout import Layout


def hashes_bytes(table: Mapping[str, str]) -> bytes:
    """Encode a table of names and sha256 as the content of hashes.json."""
    return (json.dumps(dict(sorted(table.items())), indent=2) + "\n").encode()


class ShardWriter:
    """Writer of the frames of one shard; it is added to both trees at a clean exit, else to none.

    After a clean exit `digests` holds, by tree, the sha256 of the shard's hashes.json.
    """

    def __init__(self, layout: Layout, number: int) -> None:
        self._layout, self._number = layout, number
        self._aside = layout.aside(number)
        self._rows: list[Mapping[str, Any]] = []
        self._metadata: list[Mapping[str, str | float | int]] = []
        self._hashes: dict[str, dict[str, str]] = {tree.name: {} for tree in layout.trees}
        self.digests: dict[str, str] = {}

    def __enter__(self) -> Self:
        shutil.rmtree(self._aside, ignore_errors=True)
        for tree in self._hashes:
            (self._aside / tree).mkdir(parents=True)
        return self

    def add(
        self,
        frame_id: str,
        image: Grey,
        readings: Mapping[str, str | float | int],
        truth: Mapping[str, Any],
        layers: Mapping[str, np.ndarray],
    ) -> None:
        """Add one frame.

        It has a gray image, `readings`, its columns of metadata.csv (the same in all frames), a
        truth row, and truth layers, of which there may be none. Raises OSError.
        """
        self._write("observations", f"{frame_id}.png", png_bytes(image))
        if layers:
            self._write("truth", f"{frame_id}.exr", exr_bytes(layers))
        self._metadata.append({"file_name": f"{frame_id}.png", "frame_id": frame_id, **readings})
        self._rows.append({"frame_id": frame_id, **truth})

    def __exit__(
        self,
        error_type: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        try:
            if error_type is None:
                self._close()
        finally:
            shutil.rmtree(self._aside, ignore_errors=True)

    def _write(self, tree: str, name: str, data: bytes) -> None:
        """Write a file to the temporary folder; its hash is computed from the bytes in memory."""
        self._hashes[tree][name] = digest(data)
        write_bytes(self._aside / tree / name, data)

    def _close(self) -> None:
        # Frames may be added in any order; the files reveal none.
        self._metadata.sort(key=lambda row: row["frame_id"])
        self._rows.sort(key=lambda row: row["frame_id"])
        stream = io.StringIO()
        table = csv.writer(stream, lineterminator="\n")
        table.writerow(self._metadata[0])
        table.writerows(row.values() for row in self._metadata)
        self._write("observations", "metadata.csv", stream.getvalue().encode())
        parquet = io.BytesIO()
        pl.DataFrame(self._rows, infer_schema_length=None).write_parquet(parquet)
        self._write("truth", "truth.parquet", parquet.getvalue())
        for tree in self._layout.trees:
            data = hashes_bytes(self._hashes[tree.name])
            write_bytes(self._aside / tree.name / HASHES, data)
            _replace_folder(self._aside / tree.name, self._layout.shard(tree, self._number))
            self.digests[tree.name] = digest(data)


def _replace_folder(source: Path, target: Path) -> None:
    sync_folder(source)
    if target.is_symlink() or target.is_file():
        target.unlink()
    shutil.rmtree(target, ignore_errors=True)
    source.replace(target)
    sync_folder(target.parent)
