"""Writer of shards: written to a temporary folder, then moved into place with their hashes."""

import contextlib
import csv
import errno
import io
import json
import shutil
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
import polars as pl

from solver.instrument.arrays import Grey
from solver.instrument.files import move_into_place, sync_folder, write_bytes
from solver.instrument.hashes import HASHES, digest, hashes_bytes
from solver.instrument.images import png_bytes
from vbaa_bench.dataset.aside import Aside, aside
from vbaa_bench.dataset.exr import exr_bytes
from vbaa_bench.dataset.layout import FAILURES, METADATA, TRUTH_TABLE, Layout, shard_name

# Chosen: two writers of a shard can get in each other's way once or twice.
_ATTEMPTS: Final = 10


@contextlib.contextmanager
def shard_writer(layout: Layout, number: int) -> Iterator["ShardWriter"]:
    """Write one shard; it is added to both trees at a clean exit, else to none. Raises OSError."""
    with aside(layout, shard_name(number)) as own:
        writer = ShardWriter(layout, number, own)
        yield writer
        writer.close()


class ShardWriter:
    """Writer of the frames of one shard in a temporary folder; `close` adds it to both trees.

    Several writers of the same shard do not disturb each other. When it is closed, `digests` holds,
    by tree, the sha256 of the shard's hashes.json, and `failed` is the number of failures.
    """

    def __init__(self, layout: Layout, number: int, own: Aside) -> None:
        self._layout, self._number, self._aside = layout, number, own.folder
        self.begin = own.begin
        self._failures: dict[str, str] = {}
        self._rows: list[Mapping[str, Any]] = []
        self._metadata: list[Mapping[str, str | float | int]] = []
        self._hashes: dict[str, dict[str, str]] = {tree.name: {} for tree in layout.trees}
        self.digests: dict[str, str] = {}
        for tree in self._hashes:
            (own.folder / tree).mkdir()

    @property
    def failed(self) -> int:
        """Number of frames that failed."""
        return len(self._failures)

    def add_failure(self, frame_id: str, reason: str) -> None:
        """Record why a frame is missing."""
        self._failures[frame_id] = reason

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

    def _write(self, tree: str, name: str, data: bytes) -> None:
        """Write a file to the temporary folder; its hash is computed from the bytes in memory."""
        self._hashes[tree][name] = digest(data)
        write_bytes(self._aside / tree / name, data)

    def close(self) -> None:
        """Write the tables, and move the shard into place. Raises OSError."""
        # Frames may be added in any order; the files reveal none.
        self._metadata.sort(key=lambda row: row["frame_id"])
        self._rows.sort(key=lambda row: row["frame_id"])
        stream = io.StringIO()
        table = csv.writer(stream, lineterminator="\n")
        table.writerow(self._metadata[0] if self._metadata else ("file_name", "frame_id"))
        table.writerows(row.values() for row in self._metadata)
        self._write("observations", METADATA, stream.getvalue().encode())
        parquet = io.BytesIO()
        empty = {} if self._rows else {"frame_id": pl.String}
        pl.DataFrame(self._rows, empty or None, infer_schema_length=None).write_parquet(parquet)
        self._write("truth", TRUTH_TABLE, parquet.getvalue())
        if self._failures:
            failures = json.dumps(dict(sorted(self._failures.items())), indent=2)
            self._write("truth", FAILURES, f"{failures}\n".encode())
        for tree in self._layout.trees:
            data = hashes_bytes(self._hashes[tree.name])
            write_bytes(self._aside / tree.name / HASHES, data)
            _replace_folder(self._aside / tree.name, self._layout.shard(tree, self._number))
            self.digests[tree.name] = digest(data)


def _replace_folder(source: Path, target: Path) -> None:
    sync_folder(source)
    if target.is_symlink() or target.is_file():
        target.unlink()
    for attempt in range(_ATTEMPTS):
        shutil.rmtree(target, ignore_errors=True)
        try:
            move_into_place(source, target)
            break
        except OSError as error:  # another writer of this shard has put its folder there
            if error.errno not in (errno.ENOTEMPTY, errno.EEXIST) or attempt == _ATTEMPTS - 1:
                raise
    sync_folder(target.parent)
