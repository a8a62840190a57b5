"""Light that reaches the camera by one bounce: lamp, surface, camera. Also by further ones.

The unoccluded contribution of a lamp is smooth over the lamp. A randomly shifted lattice of points
integrates it with little noise and without shadow rays. Visibility is tested for the first lattice
point only; the occluded contribution is subtracted. Both estimates are unbiased for any number of
points.
"""

from collections.abc import Sequence
from typing import Any

import drjit as dr
import mitsuba as mi

from vbaa_bench.render import lattice
from vbaa_bench.render.intersection import intersected
from vbaa_bench.render.strata import Strata, place
from vbaa_bench.render.world import World

# Lattice points per lamp for a surface that the camera sees.
LAMP_POINTS = 8
# And for one that it lights: the direction from there has more noise.
_REFLECTED_LAMP_POINTS = 2


def shaded(
    scene: Any, ray: Any, shifts: Sequence[Any], active: Any, *, seen: bool = True
) -> tuple[Any, Any]:
    """Compute the radiance along a ray, and the surface interaction it meets.

    Only if lamps are `seen`, their own radiance counts: to a surface they give it in any case.
    """
    si = intersected(scene, ray, active)
    radiance = si.emitter(scene, active).eval(si, active)[0] if seen else mi.Float(0)
    hit = active & si.is_valid()
    material = si.bsdf()
    for emitter, shift in zip(scene.emitters(), shifts, strict=True):
        points = dr.select(
            hit,
            mi.UInt32(1 if _is_point(emitter) else LAMP_POINTS if seen else _REFLECTED_LAMP_POINTS),
            1,
        )
        unoccluded, first, lamp_point = _unoccluded(emitter, si, material, shift, points, hit)
        tested = hit & (first > 0)
        hidden = tested & scene.ray_test(si.spawn_ray_to(lamp_point), tested)
        radiance += unoccluded - dr.select(hidden, first, 0)
    return radiance, si


def bounced(si: Any, direction: Any, lobe: Any, active: Any) -> tuple[Any, Any]:
    """Choose a ray that a surface reflects to where `si` was seen from, and the ray's weight.

    `direction` and `lobe` are points of the unit square.
    """
    sample, weight = si.bsdf().sample(mi.BSDFContext(), si, lobe.x, direction, active)
    return si.spawn_ray(si.to_world(sample.wo)), dr.select(active, weight[0], 0)


def shadow(world: World, si: Any, shifts: Sequence[Any], points: Any, active: Any) -> Any:
    """Compute the radiance that a surface loses to shadows of moving surfaces.

    The radiance is that towards the camera. Every lamp that is not a point is sampled at `points`
    points.
    """
    lost = mi.Float(0)
    material = si.bsdf()
    for emitter, shift in zip(world.scene.emitters(), shifts, strict=True):
        count = mi.UInt32(1) if _is_point(emitter) else points
        strip = world.strip(emitter)
        strata = None if strip is None else strip.strata(si.p, count)
        lost += _occluded(world, emitter, si, material, shift, count, active, strata)
    return lost


def _is_point(emitter: Any) -> bool:
    return bool(mi.has_flag(emitter.flags(), mi.EmitterFlags.Delta))


def _from_point(emitter: Any, si: Any, material: Any, u: Any, active: Any) -> tuple[Any, Any]:
    """Compute the radiance towards the camera from one point of a lamp, and its place.

    `u` is the point in the unit square.
    """
    sample, weight = emitter.sample_direction(si, u, active)
    value = material.eval(mi.BSDFContext(), si, si.to_local(sample.d), active)
    return (value * weight)[0], sample.p


@dr.syntax
def _unoccluded(
    emitter: Any, si: Any, material: Any, shift: Any, points: Any, active: Any
) -> tuple[Any, Any, Any]:
    """Average an emitter's unoccluded light; return it, the first point's light and position."""
    u = lattice.pair(shift, mi.UInt32(0), points)
    first, position = _from_point(emitter, si, material, u, active)
    total, number = mi.Float(first), mi.UInt32(1)
    while number < points:
        u = lattice.pair(shift, number, points)
        light, _ = _from_point(emitter, si, material, u, active)
        total += light
        number += 1
    return total / mi.Float(points), first, position


@dr.syntax
def _occluded(
    world: World,
    emitter: Any,
    si: Any,
    material: Any,
    shift: Any,
    points: Any,
    active: Any,
    strata: Strata | None,
) -> Any:
    """Average the light of an emitter's points that only moving surfaces occlude."""
    total, number = mi.Float(0), mi.UInt32(0)
    while number < points:
        u, weight = place(strata, lattice.pair(shift, number, points))
        light, position = _from_point(emitter, si, material, u, active)
        ray = si.spawn_ray_to(position)
        hidden = active & (light > 0)
        hidden &= world.scene.ray_test(ray, hidden)
        hidden &= ~world.still.ray_test(ray, hidden)
        total += dr.select(hidden, weight * light, 0)
        number += 1
    return total / mi.Float(points)
