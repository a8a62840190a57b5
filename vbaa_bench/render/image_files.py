"""Images of surfaces, beside the scene: their relative reflectances."""

from pathlib import Path

import numpy as np

from solver.instrument.arrays import Floats
from solver.instrument.errors import InputError
from solver.instrument.images import decode_grey
from vbaa_bench.dataset.scene_files import read_file
from vbaa_bench.render.environment import luminance
from vbaa_bench.scene.files import unusable_file

# Chosen: more than a camera of 8192 px resolves; in single precision 256 MB.
MAX_SIDE = 8192


@unusable_file()
def read_surface_image(folder: Path, name: str) -> Floats:
    """Read the relative reflectances (height, width) of an image; their mean is 1.

    `name` is a PNG or JPEG, whose gray values are decoded by the curve of sRGB (IEC 61966-2-1), or
    an OpenEXR image. `folder` contains the files of the scene that names it. Raises SceneFileError.
    """
    content = read_file(folder, name, "image")
    path = content.path
    if path.suffix.lower() == ".exr":
        image = luminance(content)
    else:
        gray = decode_grey(content.data, path)
        _check_size(path, gray.shape)
        levels = np.iinfo(gray.dtype).max
        # One value for each gray level, not for each pixel: the image may be large.
        image = _linear(np.arange(levels + 1) / levels)[gray]
    _check_size(path, image.shape)
    if not image.mean() > 0:
        raise InputError(f"{path}: is black, allowed is any image with a brighter part")
    image /= image.mean()
    return image


def _check_size(path: Path, shape: tuple[int, ...]) -> None:
    if max(shape) > MAX_SIDE:
        raise InputError(f"{path}: has {shape[1]} x {shape[0]} px, allowed are {MAX_SIDE} each way")


def _linear(encoded: Floats) -> Floats:
    """Decode values from 0 to 1 by the curve of sRGB."""
    return np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
