"""Radiance of lit surfaces without tracing rays: nothing casts a shadow."""

from collections.abc import Iterable, Sequence
from typing import Any, Final

import drjit as dr
import mitsuba as mi
import numpy as np

from solver.instrument.arrays import Floats
from vbaa_bench.render import lattice
from vbaa_bench.render.device_array import device_array
from vbaa_bench.render.lights import emitter
from vbaa_bench.render.loading import load
from vbaa_bench.render.materials import bsdf
from vbaa_bench.render.variant import is_scalar
from vbaa_bench.scene.lights.emitter import Emitter
from vbaa_bench.scene.paint import PaintedPart

# Points on a lamp, and directions to the surroundings. Measured on the paper's beam in all scenes
# of `scenes/lighting`: four times as many change the radiance by less than 1 %.
_LAMP_POINTS: Final = 64
_DIRECTIONS: Final = 1024


class Reflection:
    """Light of `lights` that painted surfaces reflect towards a camera.

    `render_from_antenna` (4, 4) gives render coordinates, in which single precision is enough.
    """

    def __init__(self, lights: Sequence[Emitter], render_from_antenna: Floats) -> None:
        """Build the lights alone; needs a variant of Mitsuba."""
        self._transform = render_from_antenna
        parts = {
            f"light_{i}": emitter(light, render_from_antenna) for i, light in enumerate(lights)
        }
        self._scene = load({"type": "scene", **parts})

    def radiance(
        self, paint: PaintedPart, points: Floats, normals: Floats, to_camera: Floats
    ) -> Floats:
        """Compute the radiance (n,) towards `to_camera` of surfaces at `points` [m] (all (n, 3)).

        No light comes from below the horizon, where the ground is.
        """
        material = load(bsdf(paint.paint, paint.reflectance, paint.roughness))
        places = points @ self._transform[:3, :3].T + self._transform[:3, 3]
        total = np.zeros(len(points))
        for light in self._scene.emitters():
            count = _points_on(light)
            numbers = np.arange(count)
            u = np.column_stack([numbers * lattice.GOLDEN % 1.0, (numbers + 0.5) / count])
            rows = [np.repeat(values, count, axis=0) for values in (places, normals, to_camera)]
            samples = _sampled(light, material, [*rows, np.tile(u, (len(points), 1))])
            total += samples.reshape(-1, count).mean(axis=1)
        return total


def _points_on(light: Any) -> int:
    """Return the number of samples of a light: one of a point source."""
    if mi.has_flag(light.flags(), mi.EmitterFlags.Delta):
        return 1
    return _DIRECTIONS if mi.has_flag(light.flags(), mi.EmitterFlags.Infinite) else _LAMP_POINTS


def _sampled(light: Any, material: Any, rows: Sequence[Floats]) -> Floats:
    """Compute the radiance (n,) of surfaces by one point of a light each.

    `rows` are places (n, 3), normals (n, 3), directions to the camera (n, 3), and points (n, 2) of
    the unit square, which choose that of the light.
    """
    if is_scalar():
        values = [_value(light, material, map(_vector, row)) for row in zip(*rows, strict=True)]
        return np.array(values, dtype=np.float64)
    count = len(rows[0])
    arrays = (_vector([device_array(column) for column in values.T]) for values in rows)
    return np.array(_value(light, material, arrays), dtype=np.float64) * np.ones(count)


def _vector(values: Sequence[Any]) -> Any:
    numbers = (float(value) if is_scalar() else value for value in values)
    return (mi.Vector3f if len(values) == 3 else mi.Point2f)(*numbers)


def _value(light: Any, material: Any, row: Iterable[Any]) -> Any:
    place, normal, to_camera, u = row
    surface = mi.SurfaceInteraction3f() if is_scalar() else dr.zeros(mi.SurfaceInteraction3f)
    surface.p, surface.n = mi.Point3f(place), mi.Normal3f(normal)
    surface.sh_frame = mi.Frame3f(normal)
    surface.wi = surface.to_local(to_camera)
    sample, weight = light.sample_direction(surface, u)
    value = material.eval(mi.BSDFContext(), surface, surface.to_local(sample.d)) * weight
    lit = (sample.d.z > 0) & (dr.dot(normal, sample.d) > 0) & (surface.wi.z > 0)
    return dr.select(lit, value[0], 0.0)
