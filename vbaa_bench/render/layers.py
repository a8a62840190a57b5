"""Truth layers: what lies exactly at the centre of every pixel."""

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np
import numpy.typing as npt

from solver.instrument.transforms import apply
from vbaa_bench.render.variant import is_scalar
from vbaa_bench.render.world import World


@dataclass(frozen=True)
class Layers:
    """Each (height, width). `object_index`: 0 nothing, else the surface's place from 1.

    `depth_mm` along the optical axis, `arc_length_mm` along the beam; both 0 where there is none.
    """

    object_index: npt.NDArray[np.uint32]
    depth_mm: npt.NDArray[np.float32]
    arc_length_mm: npt.NDArray[np.float32]
    beam_mask: npt.NDArray[np.float16]


def layers(world: World) -> Layers:
    """Trace one ray through every pixel's centre."""
    width, height = world.camera.width, world.camera.height
    rows, columns = np.mgrid[0:height, 0:width]
    film_x, film_y = (columns.ravel() + 0.5) / width, (rows.ravel() + 0.5) / height
    if is_scalar():
        hits = [_hit(world, x, y) for x, y in zip(film_x, film_y, strict=True)]
        index, points, arc = (np.array(values) for values in zip(*hits, strict=True))
    else:
        point = mi.Point2f(mi.Float(film_x.astype(np.float32)), mi.Float(film_y.astype(np.float32)))
        ray, _ = world.sensor.sample_ray(0.0, 0.0, point, mi.Point2f(0.5))
        si = world.scene.ray_intersect(ray)
        found = mi.UInt32(0)
        for place, name in enumerate(world.names, start=1):
            found = dr.select(si.shape == mi.ShapePtr(world.shape(name)), place, found)
        index = np.asarray(found)
        points = np.array(si.p).T
        arc = np.asarray(si.uv.x)
    beam = index == world.names.index("beam") + 1 if "beam" in world.names else index < 0
    shape = (height, width)
    depth_mm = np.where(index > 0, 1e3 * _depth(world, points), 0)
    return Layers(
        object_index=index.astype(np.uint32).reshape(shape),
        depth_mm=depth_mm.astype(np.float32).reshape(shape),
        arc_length_mm=np.where(beam, arc, 0).astype(np.float32).reshape(shape),
        beam_mask=beam.astype(np.float16).reshape(shape),
    )


def visible_share(
    arc_length_mm: npt.NDArray[np.float32], beam_mask: npt.NDArray[np.float16], length_mm: float
) -> float:
    """How much of the beam is seen: the share of a hundred even stretches that have a pixel."""
    seen = arc_length_mm[beam_mask > 0] / length_mm
    return len(np.unique(np.clip((100 * seen).astype(int), 0, 99))) / 100


def _depth(world: World, points: np.ndarray) -> np.ndarray:
    """Distance along the optical axis [m] of points (n, 3) in render coordinates."""
    metres = points * world.unit.unit + world.unit.origin
    return np.asarray(apply(world.camera.camera_from_antenna, metres)[:, 2])


def _hit(world: World, x: float, y: float) -> tuple[int, tuple[float, ...], float]:
    ray, _ = world.sensor.sample_ray(0.0, 0.0, mi.ScalarPoint2f(x, y), mi.ScalarPoint2f(0.5))
    si = world.scene.ray_intersect(ray)
    if not si.is_valid():
        return 0, (0.0, 0.0, 0.0), 0.0
    names = [name for name in world.names if si.shape == world.shape(name)]
    index = 1 + world.names.index(names[0]) if names else 0
    return index, tuple(si.p), float(si.uv.x)
