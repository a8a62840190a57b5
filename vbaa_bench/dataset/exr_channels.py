"""Reader of OpenEXR files."""

import io
from pathlib import Path
from typing import Any, Final

import numpy as np
import OpenEXR

from solver.instrument.errors import InputError
from solver.instrument.hashes import read_bytes

# Largest number of pixels times channels. Chosen: all layers of the largest image of a scene.
MAX_VALUES: Final = 10**9


def channels(path: Path) -> dict[str, np.ndarray]:
    """Read every channel (height, width) of a one-part file. Raises InputError if unreadable."""
    data = read_bytes(path)
    try:
        with OpenEXR.File(io.BytesIO(data), header_only=True) as head:
            values = sum(_values(part.header) for part in head.parts)
        if values <= MAX_VALUES:
            file = OpenEXR.File(io.BytesIO(data), separate_channels=True)
    except Exception as error:
        raise InputError(f"{path}: is not a readable EXR image ({error})") from error
    if values > MAX_VALUES:
        raise InputError(f"{path}: has {values:,} values, allowed are {MAX_VALUES:,}")
    with file:
        if not file.parts:
            raise InputError(f"{path}: is a truncated EXR image")
        return {name: np.array(channel.pixels) for name, channel in file.channels().items()}


def _values(header: dict[str, Any]) -> int:
    """Multiply the pixels of a part's data window by the number of its channels."""
    low, high = header["dataWindow"]
    width, height = (int(last) - int(first) + 1 for first, last in zip(low, high, strict=True))
    return width * height * len(header["channels"])
