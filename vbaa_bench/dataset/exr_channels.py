"""Reader of OpenEXR files."""

import io
from pathlib import Path

import numpy as np
import OpenEXR

from solver.instrument.errors import InputError
from solver.instrument.hashes import read_bytes


def channels(path: Path) -> dict[str, np.ndarray]:
    """Read every channel (height, width) of a one-part file. Raises InputError if unreadable."""
    data = io.BytesIO(read_bytes(path))
    try:
        file = OpenEXR.File(data, separate_channels=True)
    except Exception as error:
        raise InputError(f"{path}: is not a readable EXR image ({error})") from error
    with file:
        if not file.parts:
            raise InputError(f"{path}: is a truncated EXR image")
        return {name: np.array(channel.pixels) for name, channel in file.channels().items()}
