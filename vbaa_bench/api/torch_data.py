"""Frames of a dataset for training: a map-style dataset, with PyTorch if it is installed."""

import hashlib
import importlib.util
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from solver.instrument.arrays import Grey
from solver.instrument.errors import DamageError, InputError
from solver.instrument.hashes import MEND
from solver.instrument.images import decode_grey
from vbaa_bench.dataset.frame_index import FrameIndex, Shard, index_frames
from vbaa_bench.dataset.labels import USUAL_LABELS

if TYPE_CHECKING:
    from vbaa_bench.api.data import Collection, Dataset

Record = dict[str, Any]
Transform = Callable[[Record], Any]


def torch_dataset(
    data: "Path | str | Dataset | Collection",
    split: str | None = "train",
    *,
    labels: Sequence[str] = USUAL_LABELS,
    raw: bool = False,
    transform: Transform | None = None,
    check: bool = True,
) -> "FrameRecords":
    """Open the frames of a dataset or collection for training, as a `torch.utils.data.Dataset`.

    A record, `dataset[i]`, is a dict: `image` (1, h, w), 32-bit floats from 0 to 1, which is a
    saturated pixel; `labels` and `readings`, dicts of numbers by the column of truth.parquet and of
    metadata.csv (see the data dictionary), NaN where they are null; `frame_id`, `push_id`, `step`
    and `rig`, the rig's number in a collection. A method may use `image` and `readings` only.

    `split` is one of the scene's `splits`, "train" if it has none, or None for all frames. `labels`
    are columns of numbers of truth.parquet, and `contact` and `compliance_mm_per_n`; lists become
    arrays. With `raw`, images are 8 or 16-bit integers as stored. `transform` is called with every
    record, and its result returned. With `check`, all files are compared with their hashes.

    Without PyTorch, images and labels are NumPy arrays. Raises InputError if the folder is no
    complete dataset or does not have the split or a label; `dataset[i]` does for a damaged image.
    """
    root = Path(data) if isinstance(data, Path | str) else Path(data.root)
    index = index_frames(root, split, labels, check=check)
    if importlib.util.find_spec("torch") is None:
        return FrameRecords(index, raw, transform)
    from vbaa_bench.api.torch_records import TorchRecords  # torch takes seconds to import

    return TorchRecords(index, raw, transform)


class FrameRecords:
    """Records of frames as NumPy arrays, read from their files when they are requested.

    Images are compared with their hashes if the index has them.
    """

    def __init__(self, index: FrameIndex, raw: bool, transform: Transform | None) -> None:
        self.index = index
        self._raw, self._transform = raw, transform

    def __len__(self) -> int:
        return len(self.index.frame_id)

    def __getitem__(self, number: int) -> Any:
        record = self._record(number)
        return record if self._transform is None else self._transform(record)

    def __iter__(self) -> Iterator[Any]:
        return map(self.__getitem__, range(len(self)))

    def _record(self, number: int) -> Record:
        """Read the record of a frame. Raises IndexError, and InputError for its image."""
        index = self.index
        shard = index.shards[index.shard[number]]
        return {
            "image": self._image(number, shard),
            "labels": {name: column[number] for name, column in index.labels.items()},
            "readings": {name: column[number] for name, column in index.readings.items()},
            "frame_id": index.frame_id[number].decode(),
            "push_id": index.push_id[number].decode(),
            "step": int(index.step[number]),
            "rig": shard.rig,
        }

    def _image(self, number: int, shard: Shard) -> np.ndarray:
        path = Path(shard.folder) / f"{self.index.frame_id[number].decode()}.png"
        image = decode_grey(self._content(number, path), path)[None]
        return image if self._raw else _unit(image, shard.full_scale)

    def _content(self, number: int, path: Path) -> bytes:
        try:
            content = path.read_bytes()
        except OSError as error:
            raise InputError(f"{path}: cannot be read ({error.strerror})") from error
        digests = self.index.sha256
        if len(digests) and hashlib.sha256(content).digest() != digests[number].tobytes():
            raise DamageError(f"{path}: is not what was generated; {MEND}")
        return content


def _unit(image: Grey, full_scale: int) -> np.ndarray:
    """Scale gray values to 32-bit floats; `full_scale` becomes 1."""
    return np.asarray(image, np.float32) / np.float32(full_scale)
