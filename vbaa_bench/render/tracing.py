"""Radiance of chosen pixels, traced through Mitsuba's sensor, emitters, BSDFs and integrators.

A pixel's value is the mean of two independent sets of samples, each a randomly shifted lattice.
The difference between the two estimates its variance. More sets would estimate the variance better,
but one lattice with twice the points has less noise than two lattices together.
"""

from dataclasses import dataclass
from typing import Any, Literal

import drjit as dr
import mitsuba as mi
import numpy as np

from solver.instrument.arrays import Floats
from vbaa_bench.render import lattice
from vbaa_bench.render.intersection import intersected
from vbaa_bench.render.shading import bounced, shaded, shadow
from vbaa_bench.render.strata import Strata, place
from vbaa_bench.render.variant import is_scalar, uses_optix
from vbaa_bench.render.world import World

SETS = 2
# Number of random pairs of a bounce: the direction, and the lobe of the paint.
_BOUNCE = 2
# Smallest number of points of a lamp for each place in a pixel at which its shadow is measured.
# Chosen: the beam's strip of the lamp needs one of them.
_LAMP_POINTS = 2
# Maximum number of sets per call. Memory does not depend on samples per set: they are sequential.
LARGEST_WAVEFRONT = 1 << 20

# whole: radiance of the complete scene. beam: the beam's part of it. still: radiance of the still
# scene alone. change: whole minus still; exactly zero where no moving surface is on a sample's way
# to the surface or to a lamp.
Quantity = Literal["whole", "beam", "still", "change"]


@dataclass(frozen=True)
class Traced:
    """Radiance (n,) of pixels, its variance (n,), and the fraction (n,) that the beam covers.

    With two sets the variance has one degree of freedom.
    """

    radiance: Floats
    variance: Floats
    coverage: Floats


def trace(
    world: World,
    pixels: np.ndarray,
    set_size: np.ndarray,
    seed: int,
    quantity: Quantity,
    sets: int = SETS,
) -> Traced:
    """Estimate the mean radiance over the area of each of `pixels` (n, 2), integer (column, row).

    `set_size` (n,) is the number of samples per set; each pixel gets `sets` sets. A pixel's value
    depends on `seed`, on its place in the image and on its own number of samples, not on the other
    pixels of the list. On a scalar variant whole images are rendered, with the largest number of
    samples.
    """
    if is_scalar():
        return _films(world, pixels, int(set_size.max(initial=1)), seed, quantity)
    batch = LARGEST_WAVEFRONT // sets
    parts = [
        _wavefront(world, pixels[i : i + batch], set_size[i : i + batch], seed, quantity, sets)
        for i in range(0, len(pixels), batch)
    ]
    value, coverage = np.concatenate(parts, axis=2) if parts else np.empty((2, sets, 0))
    return Traced(value.mean(axis=0), value.var(axis=0, ddof=1) / sets, coverage.mean(axis=0))


def _films(world: World, pixels: np.ndarray, samples: int, seed: int, quantity: Quantity) -> Traced:
    """Render whole images in Mitsuba: without wavefronts, single rays are slow from Python."""
    sets = np.zeros((SETS, world.camera.height, world.camera.width))
    for number in range(SETS):
        set_seed = mi.UInt32((seed + number) % 2**32)
        if quantity != "still":
            sets[number] = np.asarray(mi.render(world.scene, spp=samples, seed=set_seed))[:, :, 0]
        if quantity != "whole":
            still = np.asarray(mi.render(world.still, spp=samples, seed=set_seed))[:, :, 0]
            sets[number] += still if quantity == "still" else -still
    values = sets[:, pixels[:, 1], pixels[:, 0]].T
    # Coverage is not measured.
    coverage = np.zeros(len(pixels))
    return Traced(values.mean(axis=1), values.var(axis=1, ddof=1) / SETS, coverage)


def _wavefront(
    world: World, pixels: np.ndarray, set_size: np.ndarray, seed: int, quantity: Quantity, sets: int
) -> np.ndarray:
    """Estimate radiance and coverage (2, sets, n) of each set."""
    lane = dr.arange(mi.UInt32, len(pixels) * sets)
    pixel = lane // sets
    column, row = (dr.gather(mi.Int32, mi.Int32(axis.astype(np.int32)), pixel) for axis in pixels.T)
    count = dr.gather(mi.UInt32, mi.UInt32(set_size.astype(np.uint32)), pixel)
    random = _random(seed, column, row, lane - sets * pixel)
    estimate = world.replayed(_ESTIMATES[quantity])
    value, coverage = estimate(mi.Float(column), mi.Float(row), random, count)
    dr.eval(value, coverage)
    # NumPy sums long rows faster than short ones.
    return np.array([np.asarray(one).reshape(-1, sets).T for one in (value, coverage)], np.float64)


def _random(seed: int, column: Any, row: Any, number: Any) -> Any:
    """Seed a generator of random numbers for every lane by the pixel and the number of its set.

    Its numbers do not depend on the other pixels: where another processor rounds differently, and
    one pixel more or less is sampled, the others keep their values.
    """
    mitsuba: Any = mi  # its type information has neither function
    # Two rounds of a cipher (TEA): different pixels have different states.
    first, second = mitsuba.sample_tea_32(mi.UInt32(column), mi.UInt32(row))
    # Opaque: a literal would be compiled into the kernel, anew for each seed.
    opaque_seed = dr.opaque(mi.UInt32, seed % 2**32)
    state, stream = mitsuba.sample_tea_32(first + opaque_seed, second + number)
    return mitsuba.PCG32(1, mi.UInt64(state), mi.UInt64(stream))


def _whole(
    world: World, column: Any, row: Any, random: Any, count: Any, *, beam_only: bool = False
) -> tuple[Any, Any]:
    """Estimate the radiance of the complete scene; also the fraction that the beam covers."""
    edges = world.silhouette or world.printed
    strata = None if edges is None else edges.strata(column, row, count)
    return _mean(world, world.scene, column, row, random, count, strata, beam_only)


def _beam(world: World, column: Any, row: Any, random: Any, count: Any) -> tuple[Any, Any]:
    """Estimate the beam's part of the radiance of the complete scene."""
    return _whole(world, column, row, random, count, beam_only=True)


def _still(world: World, column: Any, row: Any, random: Any, count: Any) -> tuple[Any, Any]:
    """Estimate the radiance of the still scene alone."""
    return _mean(world, world.still, column, row, random, count, None, False)


@dr.syntax
def _mean(
    world: World,
    scene: Any,
    column: Any,
    row: Any,
    random: Any,
    count: Any,
    strata: Strata | None,
    beam_only: bool,
) -> tuple[Any, Any]:
    """Average radiance over `count` samples, and the fraction of the pixel that the beam covers.

    If `beam_only`, samples that meet other surfaces have the radiance 0.
    """
    shifts = _shifts(world, scene, random)
    value, coverage, number = mi.Float(0), mi.Float(0), mi.UInt32(0)
    while number < count:
        u = lattice.point(shifts, number, count)
        u[0], weight = place(strata, u[0])
        radiance, beam = _sample(world, scene, column, row, u)
        value += weight * (beam * radiance if beam_only else radiance)
        coverage += weight * beam
        number += 1
    return value / mi.Float(count), coverage / mi.Float(count)


def _shifts(world: World, scene: Any, random: Any) -> list[Any]:
    """Draw random pairs for the ray, and for each bounce one for each emitter and _BOUNCE more."""
    lights = len(scene.emitters())
    count = world.optics.dimensions + lights + (world.bounces - 1) * (_BOUNCE + lights)
    random = type(random)(random)  # a copy: a frozen function must not change its arguments
    return [mi.Point2f(random.next_float32(), random.next_float32()) for _ in range(count)]


def _sample(world: World, scene: Any, column: Any, row: Any, u: list[Any]) -> tuple[Any, Any]:
    """Trace one sample per pixel: its radiance, and 1 where it meets the beam, else 0."""
    ray, rest = world.optics.ray(column, row, u), u[world.optics.dimensions :]
    lights = len(scene.emitters())
    radiance, si = shaded(scene, ray, rest[:lights], mi.Bool(True))
    return radiance + _reflected(world, scene, si, rest[lights:], mi.Bool(True)), _cover(world, si)


def _reflected(world: World, scene: Any, si: Any, u: list[Any], active: Any) -> Any:
    """Compute the radiance that other surfaces reflect to `si` and on to where it was seen from."""
    radiance, weight, active = mi.Float(0), mi.Float(1), active & si.is_valid()
    pairs = _BOUNCE + len(scene.emitters())
    for number in range(world.bounces - 1):
        direction, lobe, *lamps = u[number * pairs :][:pairs]
        ray, factor = bounced(si, direction, lobe, active)
        weight = weight * factor
        active = active & (weight > 0)
        reflected, si = shaded(scene, ray, lamps, active, seen=False)
        radiance += dr.select(active, weight * reflected, 0)
        active = active & si.is_valid()
    return radiance


def _change(world: World, column: Any, row: Any, random: Any, count: Any) -> tuple[Any, Any]:
    """Estimate a pixel's radiance minus the still scene's; also 1 where the beam is met, else 0.

    Shadows are smooth: a set samples few places in a pixel, but `count` points of each lamp.
    """
    if uses_optix():
        return _difference(world, column, row, random, count)
    shifts = _shifts(world, world.scene, random)
    if world.shadow_places == 1:
        return _change_at(world, column, row, shifts, count)
    return _mean_change(world, column, row, shifts, count)


@dr.syntax
def _mean_change(
    world: World, column: Any, row: Any, shifts: list[Any], count: Any
) -> tuple[Any, Any]:
    """Average the change over evenly spread places in a pixel, which share `count` samples."""
    # At least one: idle lanes have no samples, and divide nevertheless.
    places = dr.clip(count // _LAMP_POINTS, 1, world.shadow_places)
    each = (count + places - 1) // places
    value, coverage, number = mi.Float(0), mi.Float(0), mi.UInt32(0)
    while number < places:
        change, beam = _change_at(world, column, row, lattice.point(shifts, number, places), each)
        value += change
        coverage += beam
        number += 1
    return value / mi.Float(places), coverage / mi.Float(places)


def _difference(world: World, column: Any, row: Any, random: Any, count: Any) -> tuple[Any, Any]:
    """Estimate the change as `_change` does, by the same samples in one scene after the other.

    It needs more samples: a shadow is tested at one point of a lamp in each.
    """
    whole, coverage = _mean(world, world.scene, column, row, random, count, None, False)
    dr.eval(whole, coverage)
    still, _ = _mean(world, world.still, column, row, random, count, None, False)
    return whole - still, coverage


def _change_at(
    world: World, column: Any, row: Any, shifts: list[Any], count: Any
) -> tuple[Any, Any]:
    """Estimate the change at one place in a pixel, with `count` points of each lamp."""
    first, lights = world.optics.dimensions, len(world.scene.emitters())
    ray, lamps = world.optics.ray(column, row, shifts), shifts[first : first + lights]
    si = intersected(world.scene, ray, mi.Bool(True))
    moving = world.moves(world.index_of(si))
    static = si.is_valid() & ~moving
    lost = shadow(world, si, lamps, count, static)
    full, _ = shaded(world.scene, ray, lamps, moving)
    still, _ = shaded(world.still, ray, lamps, moving)
    change = dr.select(moving, full - still, -lost)
    if world.bounces > 1:
        behind = intersected(world.still, ray, mi.Bool(True))
        change += _reflected_change(world, si, behind, shifts[first + lights :], count)
    return change, _cover(world, si)


@dr.syntax
def _reflected_change(world: World, si: Any, behind: Any, shifts: list[Any], count: Any) -> Any:
    """Average over `count` samples what surfaces reflect to `si`, minus that in the still scene.

    `behind` is what is seen there. Both have the same random numbers: most light is the same.
    """
    total, number = mi.Float(0), mi.UInt32(0)
    while number < count:
        u = lattice.point(shifts, number, count)
        total += _reflected(world, world.scene, si, u, mi.Bool(True))
        total -= _reflected(world, world.still, behind, u, mi.Bool(True))
        number += 1
    return total / mi.Float(count)


def _cover(world: World, si: Any) -> Any:
    """Return 1 where the beam is met, else 0."""
    if world.beam_index is None:
        return dr.zeros(mi.Float, dr.width(si.t))
    return dr.select(world.index_of(si) == world.beam_index, mi.Float(1), 0)


_ESTIMATES = {"whole": _whole, "beam": _beam, "still": _still, "change": _change}
