"""Images with the same number of samples in every pixel, to measure on."""

from typing import Final

import numpy as np

from solver.instrument.arrays import Floats, Mask
from tests.draws import scene_seed
from vbaa_bench.render.tracing import SETS, trace
from vbaa_bench.render.world import World

# Half the side of the squares about points, without the middle pixel [px].
REACH_PX: Final = 9


def even_picture(world: World, samples: int, seed: int, about: Floats | None = None) -> Floats:
    """Radiance (height, width) with the same number of samples everywhere, in sets of squares.

    With points `about` (n, 2) [px], only in squares about them, and 0 elsewhere.
    """
    shape = world.camera.height, world.camera.width
    where: Mask = np.full(shape, about is None)
    for u, v in () if about is None else np.rint(about).astype(int):
        where[v - REACH_PX : v + REACH_PX + 1, u - REACH_PX : u + REACH_PX + 1] = True
    pixels = np.argwhere(where)[:, ::-1]
    size = np.full(len(pixels), samples // SETS)
    picture = np.zeros(shape)
    picture[where] = trace(world, pixels, size, scene_seed(seed), "whole").radiance
    return picture
