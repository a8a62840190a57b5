"""Reader of OpenEXR files."""

import io
import math
from pathlib import Path
from typing import Any, Final

import numpy as np
import OpenEXR

from solver.instrument.errors import InputError, truncated
from solver.instrument.hashes import read_bytes

# Largest number of values. Derived: 16 channels of the largest scene, 8192 x 8192 px.
MAX_VALUES: Final = 1 << 30


def channels(path: Path, max_values: int = MAX_VALUES) -> dict[str, np.ndarray]:
    """Read every channel (height, width) of a one-part file of at most `max_values` values.

    The size is read from the header, before memory is allocated. Raises InputError.
    """
    return decode_channels(read_bytes(path), path, max_values)


def decode_channels(data: bytes, path: Path, max_values: int) -> dict[str, np.ndarray]:
    """Decode the bytes of a file as `channels` does; `path` is for messages only.

    Raises InputError.
    """
    try:
        with OpenEXR.File(io.BytesIO(data), header_only=True) as head:
            sizes = [_size(part.header) for part in head.parts]
        if sum(sizes) > max_values:
            raise InputError(f"{path}: has {sum(sizes):,} values, allowed are {max_values:,}")
        file = OpenEXR.File(io.BytesIO(data), separate_channels=True)
    except InputError:
        raise
    except Exception as error:
        reason = truncated(str(error))
        raise InputError(f"{path}: is not a readable EXR image ({reason})") from error
    with file:
        if not file.parts:
            raise InputError(f"{path}: is a truncated EXR image")
        return {name: np.asarray(channel.pixels) for name, channel in file.channels().items()}


def _size(header: dict[str, Any]) -> int:
    """Compute the number of values of a part from its header."""
    low, high = header["dataWindow"]
    sides = (int(last) - int(first) + 1 for first, last in zip(low, high, strict=True))
    return math.prod(sides) * len(header["channels"])
