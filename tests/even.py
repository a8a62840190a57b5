"""Images with the same number of samples in every pixel, to measure on."""

import numpy as np

from solver.instrument.arrays import Floats
from tests.draws import scene_seed
from vbaa_bench.render.tracing import SETS, trace
from vbaa_bench.render.world import World


def even_picture(world: World, samples: int, seed: int) -> Floats:
    """Radiance (height, width) with the same number of samples everywhere, in sets of squares."""
    rows, columns = np.mgrid[0 : world.camera.height, 0 : world.camera.width]
    pixels = np.column_stack([columns.ravel(), rows.ravel()])
    size = np.full(len(pixels), samples // SETS)
    return trace(world, pixels, size, scene_seed(seed), "whole").radiance.reshape(rows.shape)
