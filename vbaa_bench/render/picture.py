"""A whole image: many samples where the beam is, few elsewhere, every pixel unbiased."""

from dataclasses import dataclass

import cv2
import numpy as np

from solver.instrument.arrays import Floats
from vbaa_bench.render.tracing import radiance
from vbaa_bench.render.world import World


@dataclass(frozen=True)
class Sampling:
    """Samples per pixel `near` the beam, that is within `near_px` of its mask, and `elsewhere`."""

    near_px: int
    near: int
    elsewhere: int


def picture(world: World, beam_mask: np.ndarray, sampling: Sampling, seed: int) -> Floats:
    """Radiance (height, width) of a world whose beam covers `beam_mask` (height, width)."""
    width = 2 * sampling.near_px + 1
    reach = np.ones((width, width), np.uint8)
    close = cv2.dilate((beam_mask > 0).astype(np.uint8), reach) > 0
    image = np.empty(close.shape)
    for part, samples, offset in ((close, sampling.near, 0), (~close, sampling.elsewhere, 1 << 16)):
        rows, columns = np.nonzero(part)
        pixels = np.column_stack([columns, rows])
        image[part] = radiance(world, pixels, samples, seed + offset)
    return image


def even_picture(world: World, samples: int, seed: int) -> Floats:
    """Radiance (height, width) with the same number of samples everywhere."""
    camera = world.camera
    nowhere = np.zeros((camera.height, camera.width))
    return picture(world, nowhere, Sampling(1, samples, samples), seed)
