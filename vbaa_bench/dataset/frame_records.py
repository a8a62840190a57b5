"""Records of frames, read from their files when they are requested."""

import hashlib
import importlib.util
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from solver.instrument.arrays import Grey
from solver.instrument.errors import DamageError, InputError
from solver.instrument.files import read_regular
from solver.instrument.hashes import MEND
from solver.instrument.images import decode_grey
from vbaa_bench.dataset.frame_index import FrameIndex, Shard

Record = dict[str, Any]
Transform = Callable[[Record], Any]


def frame_records(index: FrameIndex, raw: bool, transform: Transform | None) -> "FrameRecords":
    """Make the records of frames: tensors if PyTorch is installed, else NumPy arrays."""
    if importlib.util.find_spec("torch") is None:
        return FrameRecords(index, raw, transform)
    from vbaa_bench.dataset.torch_records import TorchRecords  # torch takes seconds to import

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
            content = read_regular(path)
        except OSError as error:
            raise InputError(f"{path}: cannot be read ({error.strerror})") from error
        digests = self.index.sha256
        if len(digests) and hashlib.sha256(content).digest() != digests[number].tobytes():
            raise DamageError(f"{path}: is not what was generated; {MEND}")
        return content


def _unit(image: Grey, full_scale: int) -> np.ndarray:
    """Scale gray values to 32-bit floats; `full_scale` becomes 1."""
    return np.asarray(image, np.float32) / np.float32(full_scale)
