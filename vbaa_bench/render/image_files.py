"""Images that a scene names: reflectances of surfaces, and radiances of the surroundings."""

from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from solver.instrument.arrays import Floats
from solver.instrument.errors import InputError, truncated
from solver.instrument.images import decode_grey
from vbaa_bench.dataset.exr import decode_channels
from vbaa_bench.dataset.scene_files import read_file
from vbaa_bench.scene.files import FileContent, unusable_file
from vbaa_bench.scene.lights.environment import plane_irradiance

# Chosen: more than a camera of 8192 px resolves; in single precision 256 MB.
MAX_SIDE = 8192
# Weights of the channels in the luminance (ITU-R BT.709).
LUMINANCE: Final = {"R": 0.2126, "G": 0.7152, "B": 0.0722}
# Chosen: a map of 8192 x 4096 px in colour and with transparency; converting it takes 1.3 GB.
MAX_VALUES: Final = 4 * 8192 * 4096


@dataclass(frozen=True)
class SceneImages:
    """Reader of the images that a scene names; `folder` contains its files."""

    folder: Path

    def environment(self, name: str) -> Floats:
        """Read a map of the surroundings; see `read_environment`."""
        return read_environment(self.folder, name)

    def image(self, name: str) -> Floats:
        """Read relative reflectances; see `read_surface_image`."""
        return read_surface_image(self.folder, name)


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


@unusable_file()
def read_environment(folder: Path, name: str) -> Floats:
    """Read the radiances of an OpenEXR image: its only channel, or the luminance of R, G, B.

    `folder` contains the files of the scene that names it. Raises SceneFileError if it cannot be
    read, or is negative, not finite, or dark above the horizon.
    """
    content = read_file(folder, name, "environment")
    image = luminance(content)
    if not plane_irradiance(image) > 0:
        raise InputError(
            f"{content.path}: is dark above the horizon, allowed is any brighter image"
        )
    return image


def luminance(content: FileContent) -> Floats:
    """Decode an OpenEXR image (height, width): its only channel, or the luminance of R, G, B.

    Raises InputError if it cannot be decoded, or is negative or not finite.
    """
    path = content.path
    by_name = decode_channels(content.data, path, MAX_VALUES)
    weights = LUMINANCE if LUMINANCE.keys() <= by_name.keys() else dict.fromkeys(by_name, 1.0)
    if weights is not LUMINANCE and len(by_name) != 1:
        names = truncated(", ".join(by_name))
        raise InputError(f"{path}: has channels {names}, allowed are R, G, B or one")
    image = np.zeros(1)
    for name, weight in weights.items():
        # Each channel is released before the next is converted: they may be large.
        image = image + weight * by_name.pop(name).astype(float)
    if not (np.isfinite(image).all() and image.min() >= 0):
        raise InputError(f"{path}: allowed are values that are finite and >= 0")
    return image
