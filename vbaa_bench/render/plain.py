"""The whole frame by Mitsuba alone: what a picture costs without this project's own sampling."""

from collections.abc import Callable
from typing import Final, Literal

import drjit as dr
import mitsuba as mi
import numpy as np

from solver.instrument.arrays import Floats
from vbaa_bench.render.camera import sensor_dict
from vbaa_bench.render.world import World

Sampler = Literal["independent", "multijitter"]
SAMPLERS: Final[tuple[Sampler, ...]] = ("multijitter", "independent")


class Plain:
    """Renders frames of a world with `mi.render`: same meshes, lights, camera, box filter and
    length of paths, the same number of samples in every pixel.

    It knows nothing of `world.lens` and of the camera's distortion.
    """

    def __init__(self, world: World, sampler: Sampler) -> None:
        described = sensor_dict(world.camera, world.unit.render_from_antenna)
        described["to_world"] = mi.ScalarTransform4f(described["to_world"])
        self._world = world
        self._sensor = mi.load_dict({**described, "sampler": {"type": sampler}})

    def radiance(self, samples: int, seed: int) -> Floats:
        """Radiance (height, width), of so many samples a pixel; a square suits multijitter."""
        world = self._world
        # A literal seed would be compiled into the kernel, and every frame into one of its own.
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
    """How long compiled kernels run while `work` is done; it must wait for their results."""
    dr.kernel_history_clear()
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        work()
        launched = dr.kernel_history([dr.KernelType.JIT])
    return 1e-3 * sum(float(kernel["execution_time"]) for kernel in launched)
