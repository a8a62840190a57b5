"""A whole image: many samples where the beam is, few elsewhere, every pixel unbiased."""

import cv2
import numpy as np

from solver.instrument.arrays import Floats
from vbaa_bench.render.tracing import radiance
from vbaa_bench.render.world import World


def picture(
    world: World, beam_mask: np.ndarray, near_px: int, near: int, elsewhere: int, seed: int
) -> Floats:
    """Radiance (height, width): `near` samples within `near_px` of the beam, else `elsewhere`."""
    reach = np.ones((2 * near_px + 1, 2 * near_px + 1), np.uint8)
    close = cv2.dilate((beam_mask > 0).astype(np.uint8), reach) > 0
    image = np.empty(close.shape)
    for part, samples, offset in ((close, near, 0), (~close, elsewhere, 1 << 16)):
        rows, columns = np.nonzero(part)
        pixels = np.column_stack([columns, rows])
        image[part] = radiance(world, pixels, samples, seed + offset)
    return image


def even_picture(world: World, samples: int, seed: int) -> Floats:
    """Radiance (height, width) with the same number of samples everywhere."""
    camera = world.camera
    nowhere = np.zeros((camera.height, camera.width))
    return picture(world, nowhere, 1, samples, samples, seed)
