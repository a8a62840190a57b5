"""Environment maps in longitude and latitude, generated or read from a file.

A map (height, width) of radiances has its first row at +z and its last at -z, as in Mitsuba. Its
columns run from +x through +y around.
"""

from pathlib import Path
from typing import Final

import numpy as np

from solver.instrument.arrays import Floats
from solver.instrument.errors import InputError, truncated
from vbaa_bench.dataset.exr_channels import decode_channels
from vbaa_bench.dataset.scene_files import read_file
from vbaa_bench.scene.files import FileContent, unusable_file

HEIGHT, WIDTH = 128, 256
# Weights of the channels in the luminance (ITU-R BT.709).
LUMINANCE: Final = {"R": 0.2126, "G": 0.7152, "B": 0.0722}
# Chosen: a map of 8192 x 4096 px in colour and with transparency; converting it takes 1.3 GB.
MAX_VALUES: Final = 4 * 8192 * 4096
# Samples along each side of a pixel: antialiases the edges of windows and lamps.
SUBPIXELS = 4
# Steps in polar angle of the integral over the upper hemisphere.
INTEGRATION_STEPS = 20_000
# Distances [m] from the rig to the room's east, north, west, south walls, ceiling, floor.
EAST, NORTH, WEST, SOUTH, CEILING, FLOOR = 3.5, 2.5, 3.0, 2.0, 2.0, 0.9
# Radiances relative to that of a white wall.
WALL, WHITE_CEILING, DARK_FLOOR, FURNITURE, TUBE, SKY, HORIZON = 1.0, 1.4, 0.3, 0.25, 60, 40, 15


def laboratory() -> Floats:
    """Generate a laboratory: a north window, two rows of ceiling lamps and a dark cupboard."""
    rows = np.clip((np.arange(HEIGHT * SUBPIXELS) + 0.5) / SUBPIXELS - 0.5, 1e-6, HEIGHT - 1 - 1e-6)
    rows *= np.pi / (HEIGHT - 1)
    columns = (np.arange(WIDTH * SUBPIXELS) + 0.5) * 2 * np.pi / (WIDTH * SUBPIXELS)
    polar, azimuth = np.meshgrid(rows, columns, indexing="ij")
    direction = np.stack(
        [np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)]
    )
    low = np.array([-WEST, -SOUTH, -FLOOR])[:, None, None]
    high = np.array([EAST, NORTH, CEILING])[:, None, None]
    # A ray from inside a box leaves through the nearest of the three sides in its direction.
    distance = np.where(direction > 0, high, low) / direction
    side = distance.argmin(axis=0)
    x, y, z = direction * distance.min(axis=0)
    radiance = np.full(side.shape, WALL)
    up, north = (side == 2) & (z > 0), (side == 1) & (y > 0)
    radiance[up] = WHITE_CEILING
    radiance[(side == 2) & (z < 0)] = DARK_FLOOR
    tubes = (abs(abs(y - 0.2) - 1.2) < 0.08) & (abs(x) % 1.5 < 1.2) & (abs(x) < 3)
    radiance[up & tubes] = TUBE
    bars = (abs(x - 0.4) < 0.04) | (abs(z - 0.9) < 0.03)
    window = north & (abs(x - 0.4) < 1.1) & (z > 0.1) & (z < 1.7) & ~bars
    radiance[window] = HORIZON + (SKY - HORIZON) * (z[window] - 0.1) / 1.6
    radiance[(side == 0) & (x < 0) & (y > -1) & (y < 0.5) & (z < 1.1)] = FURNITURE
    pixels = radiance.reshape(HEIGHT, SUBPIXELS, WIDTH, SUBPIXELS)
    return np.asarray(pixels.mean(axis=(1, 3)))


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


def plane_irradiance(image: Floats) -> float:
    """Integrate the irradiance of a map on a plane that faces +z."""
    height = len(image)
    polar = (np.arange(INTEGRATION_STEPS) + 0.5) * (np.pi / 2) / INTEGRATION_STEPS
    ring = np.interp(polar, np.linspace(0, np.pi, height), image.mean(axis=1))
    return float(2 * np.pi * np.mean(ring * np.cos(polar) * np.sin(polar)) * np.pi / 2)


def rotated(image: Floats, angle: float) -> Floats:
    """Rotate a map about +z by an angle [rad], rounded to whole columns."""
    width = image.shape[1]
    return np.roll(image, round(angle * width / (2 * np.pi)), axis=1)
