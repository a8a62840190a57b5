"""Light that reaches the camera by one bounce: lamp, surface, camera.

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

# Lattice points per lamp for a surface that the camera sees.
LAMP_POINTS = 8


def shaded(scene: Any, ray: Any, shifts: Sequence[Any], active: Any) -> tuple[Any, Any]:
    """Compute the radiance along a ray, and the surface interaction it meets."""
    si = scene.ray_intersect(ray, active)
    radiance = si.emitter(scene, active).eval(si, active)[0]
    hit = active & si.is_valid()
    material = si.bsdf()
    for emitter, shift in zip(scene.emitters(), shifts, strict=True):
        points = mi.UInt32(1 if _is_point(emitter) else LAMP_POINTS)
        unoccluded, first, lamp_point = _unoccluded(emitter, si, material, shift, points, hit)
        tested = hit & (first > 0)
        hidden = tested & scene.ray_test(si.spawn_ray_to(lamp_point), tested)
        radiance += unoccluded - dr.select(hidden, first, 0)
    return radiance, si


def shadow(scene: Any, still: Any, si: Any, shifts: Sequence[Any], points: Any, active: Any) -> Any:
    """Compute the radiance that a surface loses to shadows in `scene` that are not in `still`.

    The radiance is that towards the camera. Every lamp that is not a point is sampled at `points`
    points.
    """
    lost = mi.Float(0)
    material = si.bsdf()
    for emitter, shift in zip(scene.emitters(), shifts, strict=True):
        count = mi.UInt32(1) if _is_point(emitter) else points
        lost += _occluded(scene, still, emitter, si, material, shift, count, active)
    return lost


def _is_point(emitter: Any) -> bool:
    return bool(mi.has_flag(emitter.flags(), mi.EmitterFlags.Delta))


def _from_point(
    emitter: Any, si: Any, material: Any, shift: Any, number: Any, points: Any, active: Any
) -> tuple[Any, Any]:
    """Compute the radiance towards the camera from one lattice point of a lamp, and its place."""
    u = lattice.pair(shift, number, points)
    sample, weight = emitter.sample_direction(si, u, active)
    value = material.eval(mi.BSDFContext(), si, si.to_local(sample.d), active)
    return (value * weight)[0], sample.p


@dr.syntax
def _unoccluded(
    emitter: Any, si: Any, material: Any, shift: Any, points: Any, active: Any
) -> tuple[Any, Any, Any]:
    """Average an emitter's unoccluded light; return it, the first point's light and position."""
    first, position = _from_point(emitter, si, material, shift, mi.UInt32(0), points, active)
    total, number = mi.Float(first), mi.UInt32(1)
    while number < points:
        light, _ = _from_point(emitter, si, material, shift, number, points, active)
        total += light
        number += 1
    return total / mi.Float(points), first, position


@dr.syntax
def _occluded(
    scene: Any,
    still: Any,
    emitter: Any,
    si: Any,
    material: Any,
    shift: Any,
    points: Any,
    active: Any,
) -> Any:
    """Average the light of an emitter's points that are occluded in `scene` but not in `still`."""
    total, number = mi.Float(0), mi.UInt32(0)
    while number < points:
        light, position = _from_point(emitter, si, material, shift, number, points, active)
        ray = si.spawn_ray_to(position)
        hidden = active & (light > 0)
        hidden &= scene.ray_test(ray, hidden)
        hidden &= ~still.ray_test(ray, hidden)
        total += dr.select(hidden, light, 0)
        number += 1
    return total / mi.Float(points)
