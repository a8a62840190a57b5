"""Radiance of chosen pixels, traced through Mitsuba's sensor, emitters, BSDFs and integrators.

A pixel's value is the mean of two independent sets of samples, each a randomly shifted lattice;
the spread between the two tells its variance. More sets would tell it better, but one lattice of
twice the points has less noise than two lattices together.
"""

from dataclasses import dataclass
from typing import Any, Literal

import drjit as dr
import mitsuba as mi
import numpy as np

from solver.instrument.arrays import Floats
from vbaa_bench.render import lattice
from vbaa_bench.render.shading import shaded, shadow
from vbaa_bench.render.variant import is_scalar
from vbaa_bench.render.world import World

SETS = 2
# Sets in one call. A set's samples are taken one after the other, so their number needs no memory.
LARGEST_WAVEFRONT = 1 << 20

# whole: everything that a pixel shows. still: what the still scene alone shows. change: by how
# much a pixel differs from it; exactly zero where a sample meets nothing that moves, on its way to
# the surface or to a lamp.
Asked = Literal["whole", "still", "change"]


@dataclass(frozen=True)
class Traced:
    """Radiance (n,) of pixels, its variance (n,), of one degree of freedom, and the share (n,) of
    each that the beam covers."""

    radiance: Floats
    variance: Floats
    coverage: Floats


def trace(
    world: World,
    pixels: np.ndarray,
    set_size: np.ndarray,
    seed: int,
    asked: Asked,
    sets: int = SETS,
) -> Traced:
    """Radiance of `pixels` (n, 2), integer (column, row), over the area of each.

    `set_size` (n,) samples a set, `sets` times as many a pixel. A pixel's value depends on `seed`,
    on its place in the list and on its own number of samples. On a scalar variant whole images
    are rendered, with the largest of the numbers.
    """
    if is_scalar():
        return _films(world, pixels, int(set_size.max(initial=1)), seed, asked)
    batch = LARGEST_WAVEFRONT // sets
    parts = [
        _wavefront(world, pixels[i : i + batch], set_size[i : i + batch], seed + i, asked, sets)
        for i in range(0, len(pixels), batch)
    ]
    value, covered = np.concatenate(parts, axis=1) if parts else np.empty((2, 0, sets))
    return Traced(value.mean(axis=1), value.var(axis=1, ddof=1) / sets, covered.mean(axis=1))


def _films(world: World, pixels: np.ndarray, samples: int, seed: int, asked: Asked) -> Traced:
    """Without wavefronts single rays are slow from Python: render everything, in Mitsuba."""
    sets = np.zeros((SETS, world.camera.height, world.camera.width))
    for number in range(SETS):
        each = mi.UInt32((seed + number) % 2**32)
        if asked != "still":
            sets[number] = np.asarray(mi.render(world.scene, spp=samples, seed=each))[:, :, 0]
        if asked != "whole":
            still = np.asarray(mi.render(world.still, spp=samples, seed=each))[:, :, 0]
            sets[number] += still if asked == "still" else -still
    chosen = sets[:, pixels[:, 1], pixels[:, 0]].T
    # What the beam covers is not told.
    covered = np.zeros(len(pixels))
    return Traced(chosen.mean(axis=1), chosen.var(axis=1, ddof=1) / SETS, covered)


def _wavefront(
    world: World, pixels: np.ndarray, set_size: np.ndarray, seed: int, asked: Asked, sets: int
) -> np.ndarray:
    """Radiance and cover (2, n, sets) of each set."""
    lanes = len(pixels) * sets
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(seed % 2**32, lanes)
    pixel = dr.arange(mi.UInt32, lanes) // sets
    column, row = (
        dr.gather(mi.Float, mi.Float(places.astype(np.float32)), pixel) for places in pixels.T
    )
    count = dr.gather(mi.UInt32, mi.UInt32(set_size.astype(np.uint32)), pixel)
    if asked == "change":
        value, covered = _change(world, column, row, sampler, count)
    else:
        scene = world.still if asked == "still" else world.scene
        value, covered = _mean(world, scene, column, row, sampler, count)
    dr.eval(value, covered)
    both = np.array([np.asarray(part, np.float64) for part in (value, covered)])
    return both.reshape(2, -1, sets)


@dr.syntax
def _mean(
    world: World, scene: Any, column: Any, row: Any, sampler: Any, count: Any
) -> tuple[Any, Any]:
    """Mean radiance of `count` samples, and of one where the beam is met."""
    shifts = _shifts(world, scene, sampler)
    value, covered, number = mi.Float(0), mi.Float(0), mi.UInt32(0)
    while number < count:
        u = lattice.point(shifts, number, count)
        seen, beam = _sample(world, scene, column, row, sampler, u)
        value += seen
        covered += beam
        number += 1
    return value / mi.Float(count), covered / mi.Float(count)


def _shifts(world: World, scene: Any, sampler: Any) -> list[Any]:
    """Random pairs, for the ray and then for each emitter."""
    return [sampler.next_2d() for _ in range(world.optics.dimensions + len(scene.emitters()))]


def _sample(
    world: World, scene: Any, column: Any, row: Any, sampler: Any, u: list[Any]
) -> tuple[Any, Any]:
    """Radiance of one sample of pixels, and one where it meets the beam."""
    ray, lamps = world.optics.ray(column, row, u), u[world.optics.dimensions :]
    if world.bounces == 1:
        seen, si = shaded(scene, ray, lamps, mi.Bool(True))
        return seen, _cover(world, si)
    value, _, _ = world.integrator.sample(scene, sampler, mi.RayDifferential3f(ray))
    return value[0], _cover(world, scene.ray_intersect(ray))


def _change(world: World, column: Any, row: Any, sampler: Any, count: Any) -> tuple[Any, Any]:
    """How much a pixel shows more than in the still scene, and one where it shows the beam.

    Shadows are soft: a set asks at one place of a pixel, but at `count` points of the lamp.
    """
    optics = world.optics
    shifts = _shifts(world, world.scene, sampler)
    ray, lamps = optics.ray(column, row, shifts), shifts[optics.dimensions :]
    si = world.scene.ray_intersect(ray)
    other = world.moves(world.index_of(si))
    stays = si.is_valid() & ~other
    lost = shadow(world.scene, world.still, si, lamps, count, stays)
    whole, _ = shaded(world.scene, ray, lamps, other)
    without, _ = shaded(world.still, ray, lamps, other)
    return dr.select(other, whole - without, -lost), _cover(world, si)


def _cover(world: World, si: Any) -> Any:
    """One where the beam is met."""
    if "beam" not in world.names:
        return dr.zeros(mi.Float, dr.width(si.t))
    return dr.select(world.index_of(si) == world.names.index("beam") + 1, mi.Float(1), 0)
