"""Writer of shards: written to a temporary folder, then moved into place with their hashes."""

import csv
import errno
import io
import json
import os
import shutil
import socket
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, Final, Self

import numpy as np
import polars as pl

from solver.instrument.arrays import Grey
from solver.instrument.files import sync_folder, write_bytes
from solver.instrument.hashes import HASHES, digest
from solver.instrument.images import png_bytes
from vbaa_bench.dataset.exr import exr_bytes
from vbaa_bench.dataset.layout import Layout


def hashes_bytes(table: Mapping[str, str]) -> bytes:
    """Encode a table of names and texts, such as the content of hashes.json."""
    return (json.dumps(dict(sorted(table.items())), indent=2) + "\n").encode()


# Reasons by frame id, in the truth of a shard that lacks frames.
FAILURES: Final = "failures.json"
# Chosen: two writers of a shard can get in each other's way once or twice.
_ATTEMPTS: Final = 10
# Name of the frame that is being rendered, in a temporary folder.
_CURRENT: Final = "current"


def interrupted_frames(layout: Layout, number: int) -> Counter[str]:
    """Count, by frame, the writers of a shard that died while they rendered it."""
    names = Counter[str]()
    for folder in layout.all_aside(number):
        try:
            names[(folder / _CURRENT).read_text(encoding="utf-8")] += 1
        except (OSError, UnicodeDecodeError):
            continue
    return names


class ShardWriter:
    """Writer of the frames of one shard; it is added to both trees at a clean exit, else to none.

    Several writers of the same shard do not disturb each other: each has its own temporary folder.
    After a clean exit `digests` holds, by tree, the sha256 of the shard's hashes.json, and `failed`
    is the number of failures.
    """

    def __init__(self, layout: Layout, number: int) -> None:
        self._layout, self._number = layout, number
        self._aside = layout.aside(number, f"{socket.gethostname()}-{os.getpid()}")
        self._failures: dict[str, str] = {}
        self._rows: list[Mapping[str, Any]] = []
        self._metadata: list[Mapping[str, str | float | int]] = []
        self._hashes: dict[str, dict[str, str]] = {tree.name: {} for tree in layout.trees}
        self.digests: dict[str, str] = {}

    def __enter__(self) -> Self:
        shutil.rmtree(self._aside, ignore_errors=True)
        for tree in self._hashes:
            (self._aside / tree).mkdir(parents=True)
        return self

    @property
    def failed(self) -> int:
        """Number of frames that failed."""
        return len(self._failures)

    def begin(self, frame_id: str) -> None:
        """Leave the name of the next frame, should this process die. Raises OSError."""
        (self._aside / _CURRENT).write_text(frame_id, encoding="utf-8")

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
        table.writerow(self._metadata[0] if self._metadata else ("file_name", "frame_id"))
        table.writerows(row.values() for row in self._metadata)
        self._write("observations", "metadata.csv", stream.getvalue().encode())
        parquet = io.BytesIO()
        empty = {} if self._rows else {"frame_id": pl.String}
        pl.DataFrame(self._rows, empty or None, infer_schema_length=None).write_parquet(parquet)
        self._write("truth", "truth.parquet", parquet.getvalue())
        if self._failures:
            self._write("truth", FAILURES, hashes_bytes(self._failures))
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
            source.replace(target)
            break
        except OSError as error:  # another writer of this shard has put its folder there
            if error.errno not in (errno.ENOTEMPTY, errno.EEXIST) or attempt == _ATTEMPTS - 1:
                raise
    sync_folder(target.parent)
