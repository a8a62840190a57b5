"""Mitsuba alone, as a reference for this project's own sampling: whole frames, and rays."""

from collections.abc import Callable
from typing import Final, Literal

import drjit as dr
import mitsuba as mi
import numpy as np

from solver.instrument.arrays import Floats
from vbaa_bench.render.camera import sensor_dict
from vbaa_bench.render.loading import load
from vbaa_bench.render.world import World

Sampler = Literal["independent", "multijitter"]
SAMPLERS: Final[tuple[Sampler, ...]] = ("multijitter", "independent")


class Plain:
    """A renderer of a world's frames by `mi.render`, with the same number of samples in all pixels.

    Meshes, lights, camera, box filter and path length are those of the world. `world.lens` and the
    camera's distortion are ignored.
    """

    def __init__(self, world: World, sampler: Sampler) -> None:
        sensor = sensor_dict(world.camera, world.unit.render_from_antenna)
        sensor["to_world"] = mi.ScalarTransform4f(sensor["to_world"])
        self._world = world
        self._sensor = load({**sensor, "sampler": {"type": sampler}})

    def radiance(self, samples: int, seed: int) -> Floats:
        """Render the radiance (height, width); for multijitter, choose a square of `samples`."""
        world = self._world
        # A literal seed would be compiled into the kernel: each frame would need a new kernel.
        opaque_seed = dr.opaque(mi.UInt32, seed % 2**32)
        film = mi.render(
            world.scene,
            sensor=self._sensor,
            integrator=world.integrator,
            spp=samples,
            seed=opaque_seed,
        )
        return np.asarray(np.asarray(film)[..., 0], dtype=np.float64)


def seconds_in_kernels(work: Callable[[], object]) -> float:
    """Measure the run time [s] of compiled kernels in `work`, which must wait for their results."""
    dr.kernel_history_clear()
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        work()
        kernels = dr.kernel_history([dr.KernelType.JIT])
    return 1e-3 * sum(float(kernel["execution_time"]) for kernel in kernels)


def seconds_of_rays(world: World, pixels: np.ndarray, seed: int) -> float:
    """Measure the seconds of the kernel that traces one ray through each of `pixels` (n, 2).

    It finds the nearest surface and does nothing else.
    """
    sampler = load({"type": "independent"})
    sampler.seed(seed, len(pixels))
    column, row = (mi.Float(mi.UInt32(axis.astype(np.uint32))) for axis in pixels.T)
    shifts = [sampler.next_2d() for _ in range(world.optics.dimensions)]
    ray = world.optics.ray(column, row, shifts)
    dr.eval(ray)
    return seconds_in_kernels(lambda: dr.eval(world.scene.ray_intersect_preliminary(ray).t))
