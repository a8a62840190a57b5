"""Images of surfaces, beside the scene: their relative reflectances."""

from pathlib import Path

import numpy as np

from solver.instrument.arrays import Floats
from solver.instrument.errors import InputError
from solver.instrument.images import read_grey
from vbaa_bench.render.environment import read_luminance
from vbaa_bench.scene.files import file_of_scene

# Chosen: more than a camera of 8192 px resolves; in single precision 256 MB.
MAX_SIDE = 8192


def read_surface_image(folder: Path, name: str) -> Floats:
    """Read the relative reflectances (height, width) of an image; their mean is 1.

    `name` is a PNG or JPEG, whose gray values are decoded by the curve of sRGB (IEC 61966-2-1), or
    an OpenEXR image. It must be within `folder`, also if it is a link. Raises InputError.
    """
    path = file_of_scene(folder, name)
    if path.suffix.lower() == ".exr":
        image = read_luminance(path)
    else:
        gray = read_grey(path)
        image = _linear(gray / np.iinfo(gray.dtype).max)
    if max(image.shape) > MAX_SIDE:
        raise InputError(
            f"{path}: has {image.shape[1]} x {image.shape[0]} px, allowed are {MAX_SIDE} each way"
        )
    if not image.mean() > 0:
        raise InputError(f"{path}: is black, allowed is any image with a brighter part")
    return np.asarray(image / image.mean())


def _linear(encoded: Floats) -> Floats:
    """Decode values from 0 to 1 by the curve of sRGB."""
    return np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
