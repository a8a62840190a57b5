"""OpenEXR files, read whole."""

from pathlib import Path

import numpy as np
import OpenEXR

from solver.instrument.errors import InputError


def channels(path: Path) -> dict[str, np.ndarray]:
    """Every channel (height, width) of a file of one part. Raises InputError if it is none."""
    if path.exists() and not path.is_file():  # a pipe or a device may never end
        raise InputError(f"{path}: is not an EXR image that can be read (it is no file)")
    try:
        file = OpenEXR.File(str(path), separate_channels=True)
    except Exception as error:
        raise InputError(f"{path}: is not an EXR image that can be read ({error})") from error
    with file:
        if not file.parts:
            raise InputError(f"{path}: is a truncated EXR image")
        return {name: np.array(channel.pixels) for name, channel in file.channels().items()}
