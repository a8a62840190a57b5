"""Truth layers: the surface at the exact centre of every pixel."""

from dataclasses import dataclass, fields, replace
from functools import partial
from typing import Any, Self

import drjit as dr
import mitsuba as mi
import numpy as np
import numpy.typing as npt

from solver.instrument.arrays import Floats, Mask
from vbaa_bench.render.intersection import intersected
from vbaa_bench.render.variant import is_scalar
from vbaa_bench.render.world import World

# Maximum number of surfaces in front of the beam up to which it is searched for.
_MAX_SURFACES = 4


@dataclass(frozen=True)
class Layers:
    """The truth layers, each (height, width), but `normal` (height, width, 3).

    `object_index` is 0 for no surface, else the surface's place in the world, counted from 1.
    `depth_mm` is along the optical axis, `arc_length_mm` along the beam, and `normal` is in
    Sigma_a, towards the camera; all are 0 where they do not exist. `occlusion` marks pixels where
    the beam is behind another surface.
    """

    object_index: npt.NDArray[np.uint32]
    depth_mm: npt.NDArray[np.float32]
    normal: npt.NDArray[np.float32]
    arc_length_mm: npt.NDArray[np.float32]
    beam_mask: Mask
    occlusion: Mask

    @classmethod
    def empty(cls, height: int, width: int) -> Self:
        """Create the layers of an empty image."""
        shape = (height, width)
        return cls(
            np.zeros(shape, np.uint32),
            np.zeros(shape, np.float32),
            np.zeros((*shape, 3), np.float32),
            np.zeros(shape, np.float32),
            np.zeros(shape, np.bool_),
            np.zeros(shape, np.bool_),
        )

    def with_pixels(self, where: Mask, values: Self) -> Self:
        """Return a copy with `values`, each (n, ...), in the pixels of `where` (height, width)."""
        changed = {}
        for field in fields(self):
            layer = getattr(self, field.name).copy()
            layer[where] = getattr(values, field.name)
            changed[field.name] = layer
        return replace(self, **changed)


def layers(world: World, where: Mask, otherwise: Layers, *, still: bool = False) -> Layers:
    """Trace one ray through the centre of every pixel of `where` (height, width).

    Other pixels are those of `otherwise`. With `still`, only the still scene is traced.
    """
    rows, columns = np.nonzero(where)
    if not len(rows):
        return otherwise
    return otherwise.with_pixels(where, _trace_centres(world, columns, rows, still))


def every_pixel(world: World, *, still: bool = False) -> Layers:
    """Compute the layers of a whole image."""
    shape = (world.camera.height, world.camera.width)
    return layers(world, np.ones(shape, np.bool_), Layers.empty(*shape), still=still)


def _trace_centres(world: World, columns: np.ndarray, rows: np.ndarray, still: bool) -> Layers:
    if is_scalar():
        return _one_by_one(world, columns, rows, still)
    column, row = (mi.Float(mi.UInt32(values.astype(np.uint32))) for values in (columns, rows))
    centres = partial(_centres, world, still=True) if still else world.replayed(_centres)
    centre_layers = centres(column, row)
    dr.eval(centre_layers)  # all in one kernel
    index, p, uv, facing, beam, hidden = centre_layers
    indices = np.asarray(index)
    # One coordinate after the other: Dr.Jit would compile a kernel anew to interleave them.
    points = np.stack([np.asarray(axis) for axis in p], axis=-1)
    normals = np.stack([np.asarray(axis) for axis in facing], axis=-1)
    depth = np.where(indices > 0, 1e3 * _depth(world, points), 0)
    arc = np.where(np.broadcast_to(np.asarray(beam), indices.shape), np.asarray(uv.x), 0)
    return Layers(
        object_index=indices.astype(np.uint32),
        depth_mm=depth.astype(np.float32),
        normal=normals.astype(np.float32),
        arc_length_mm=arc.astype(np.float32),
        beam_mask=np.broadcast_to(np.asarray(beam), indices.shape),
        occlusion=np.broadcast_to(np.asarray(hidden), indices.shape),
    )


def _centres(world: World, column: Any, row: Any, still: bool = False) -> tuple[Any, ...]:
    """Trace the rays through pixel centres: index, place, texture coordinates and normal.

    Also whether they meet the beam, and whether the beam is behind what they meet.
    """
    ray = world.optics.centre_ray(column, row)
    si = intersected(world.still if still else world.scene, ray, mi.Bool(True))
    index = world.index_of(si, still=still)
    towards = dr.select(dr.dot(si.n, ray.d) < 0, si.n, -si.n)
    facing = dr.select(si.is_valid(), towards, mi.Normal3f(0))
    beam = mi.Bool(False)
    hidden = mi.Bool(False)
    if world.beam_index is not None and not still:
        beam = index == world.beam_index
        hidden = _behind(world, ray, si, beam, world.beam_index)
    return index, si.p, si.uv, facing, beam, hidden


def _one_by_one(world: World, columns: np.ndarray, rows: np.ndarray, still: bool) -> Layers:
    """Trace rays one by one, without wavefronts; `occlusion` is not computed."""
    scene, hits = (world.still if still else world.scene), []
    for column, row in zip(columns, rows, strict=True):
        ray = world.optics.centre_ray(float(column), float(row))
        si = scene.ray_intersect(ray)
        normal = np.array(si.n) if si.is_valid() else np.zeros(3)
        normal *= -np.sign(normal @ np.array(ray.d))
        hits.append((world.scalar_index(si, still=still), *si.p, *normal, si.uv.x))
    index, *values = np.array(hits).T
    points, normals, uv = np.array(values[:3]).T, np.array(values[3:6]).T, values[6]
    beam = index == (-1 if world.beam_index is None else world.beam_index)
    return Layers(
        object_index=index.astype(np.uint32),
        depth_mm=np.where(index > 0, 1e3 * _depth(world, points), 0).astype(np.float32),
        normal=normals.astype(np.float32),
        arc_length_mm=np.where(beam, uv, 0).astype(np.float32),
        beam_mask=beam,
        occlusion=np.zeros(len(index), np.bool_),
    )


def _behind(world: World, ray: Any, si: Any, beam: Any, number: int) -> Any:
    """Test whether the beam is behind the first surface that a ray meets."""
    hidden = mi.Bool(False)
    searching = si.is_valid() & ~beam
    for _ in range(_MAX_SURFACES):
        si = intersected(world.scene, si.spawn_ray(ray.d), searching)
        reached = searching & (world.index_of(si) == number)
        hidden |= reached
        searching &= si.is_valid() & ~reached
    return hidden


def _depth(world: World, points: Floats) -> Floats:
    """Compute distances along the optical axis [m] of points (n, 3) in render coordinates."""
    pose = world.camera.camera_from_antenna
    metres = points * world.unit.unit + world.unit.origin
    return np.asarray(metres @ pose[2, :3] + pose[2, 3])
