"""Shards: made aside, moved into place whole."""

import csv
import io
import os
import shutil
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
import polars as pl

from solver.instrument.arrays import Grey
from solver.instrument.files import write_bytes, write_text
from solver.instrument.images import png_bytes
from vbaa_bench.dataset.exr import write_exr
from vbaa_bench.dataset.layout import Layout


class ShardWriter:
    """Writes the frames of one shard; on a clean exit both trees get it, otherwise neither."""

    def __init__(self, layout: Layout, number: int) -> None:
        self._layout, self._number = layout, number
        self._aside = layout.aside(number)
        self._rows: list[Mapping[str, Any]] = []
        self._metadata: list[Mapping[str, str | float | int]] = []

    def __enter__(self) -> Self:
        shutil.rmtree(self._aside, ignore_errors=True)
        for tree in ("observations", "truth"):
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
        """One frame: gray image, its columns of metadata.csv (the same in all frames), truth row,
        truth layers (may be none)."""
        write_bytes(self._aside / "observations" / f"{frame_id}.png", png_bytes(image))
        if layers:
            write_exr(self._aside / "truth" / f"{frame_id}.exr", layers)
        self._metadata.append({"file_name": f"{frame_id}.png", "frame_id": frame_id, **readings})
        self._rows.append({"frame_id": frame_id, **truth})

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if kind is None:
            self._close()
        shutil.rmtree(self._aside, ignore_errors=True)

    def _close(self) -> None:
        stream = io.StringIO()
        table = csv.writer(stream, lineterminator="\n")
        table.writerow(self._metadata[0])
        table.writerows(row.values() for row in self._metadata)
        write_text(self._aside / "observations" / "metadata.csv", stream.getvalue())
        parquet = io.BytesIO()
        pl.DataFrame(self._rows, infer_schema_length=None).write_parquet(parquet)
        write_bytes(self._aside / "truth" / "truth.parquet", parquet.getvalue())
        # The observations go last: a shard is finished when they are in place.
        layout = self._layout
        for tree, name in ((layout.truth, "truth"), (layout.observations, "observations")):
            _replace_folder(self._aside / name, layout.shard(tree, self._number))


def _replace_folder(source: Path, target: Path) -> None:
    shutil.rmtree(target, ignore_errors=True)
    for path in (*source.iterdir(), source):
        descriptor = os.open(path, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
    source.replace(target)
