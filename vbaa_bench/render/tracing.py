"""Radiance of chosen pixels, traced through Mitsuba's own sensor, sampler and integrator."""

import drjit as dr
import mitsuba as mi
import numpy as np

from solver.instrument.arrays import Floats
from vbaa_bench.render.variant import is_scalar
from vbaa_bench.render.world import World

# Rays in flight at once; bounds the memory of a call.
LARGEST_WAVEFRONT = 1 << 22


def radiance(world: World, pixels: np.ndarray, samples: int, seed: int) -> Floats:
    """Mean radiance (n,) over the area of each of `pixels` (n, 2), as integer (column, row).

    `samples` rays a pixel from a multi-jittered sampler: pixel position and light are stratified
    over the pixel's own samples. A pixel's value depends on `seed` and its place in `pixels`.
    On a scalar variant the whole film is rendered for them.
    """
    if is_scalar():
        film = _whole_film(world, samples, seed)
        return np.asarray(film[pixels[:, 1], pixels[:, 0]])
    batch = max(LARGEST_WAVEFRONT // samples, 1)
    parts = [
        _wavefront(world, pixels[first : first + batch], samples, seed + number)
        for number, first in enumerate(range(0, len(pixels), batch))
    ]
    return np.concatenate(parts) if parts else np.empty(0)


def _wavefront(world: World, pixels: np.ndarray, samples: int, seed: int) -> Floats:
    size = len(pixels) * samples
    sampler = mi.load_dict({"type": "multijitter", "sample_count": samples})
    sampler.set_samples_per_wavefront(samples)
    sampler.seed(seed % 2**32, size)
    pixel = dr.arange(mi.UInt32, size) // samples
    column = dr.gather(mi.Float, mi.Float(pixels[:, 0].astype(np.float32)), pixel)
    row = dr.gather(mi.Float, mi.Float(pixels[:, 1].astype(np.float32)), pixel)
    inside = sampler.next_2d()
    film = mi.Point2f(
        (column + inside.x) / world.camera.width, (row + inside.y) / world.camera.height
    )
    ray, _ = world.sensor.sample_ray(0.0, 0.0, film, mi.Point2f(0.5))
    value, _, _ = world.integrator.sample(world.scene, sampler, mi.RayDifferential3f(ray))
    mean = dr.block_sum(value[0], samples) / samples
    return np.asarray(mean, dtype=np.float64)


def _whole_film(world: World, samples: int, seed: int) -> Floats:
    """Without wavefronts single rays are slow from Python: render everything, in Mitsuba."""
    image = mi.render(world.scene, sensor=world.sensor, spp=samples, seed=mi.UInt32(seed % 2**32))
    return np.asarray(image, dtype=np.float64)[:, :, 0]
