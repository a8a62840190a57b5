"""The beam's mesh against the smooth tube that Mitsuba itself sweeps along a B-spline."""

import copy
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.linalg import solve_banded

from results.render_speed.image_error import Line, beam_line
from solver.instrument.arrays import Floats
from tests.draws import scene_seed
from vbaa_bench.assembly.plan import plan
from vbaa_bench.generation.frame_renderer import FrameRenderer
from vbaa_bench.render.loading import load
from vbaa_bench.render.tracing import trace
from vbaa_bench.render.variant import PLAIN
from vbaa_bench.render.world import World
from vbaa_bench.scene.load import load_scene

PIECES = 480
# Samples a set of a tracing; mesh and curve are traced in pairs, with the same random numbers.
SET_SIZE = 144
# Ends are left out: the curve has no caps, and at the hub the beam comes out of it.
ENDS_PX = 8


def control_points(points: Floats) -> Floats:
    """Control points (n + 2, 3) of the uniform cubic B-spline through points (n, 3).

    Its value at a knot is (P[i-1] + 4 P[i] + P[i+1]) / 6; at the ends it does not bend.
    """
    bands = np.ones((3, len(points)))
    bands[1] = 4
    # P[-1] = 2 P[0] - P[1] leaves 6 P[0], and so at the other end.
    bands[1, [0, -1]], bands[0, 1], bands[2, -2] = 6, 0, 0
    inner = solve_banded((1, 1), bands, 6 * points)
    return np.vstack([2 * inner[0] - inner[1], inner, 2 * inner[-1] - inner[-2]])


@dataclass(frozen=True)
class Roads:
    """Radiances (pairs, h, w) of the beam as mesh and as curve, where it runs, and how far the
    B-spline leaves the centreline over the beam's radius."""

    mesh: Floats
    curve: Floats
    line: Line
    apart: float


def roads_of(path: Path, variant: str, tolerance_px: float, folder: Path, pairs: int) -> Roads:
    file = load_scene(path)
    work = plan(file)
    render = file.scene.render.model_copy(update={"mesh_tolerance_px": tolerance_px})
    scene = file.scene.model_copy(update={"render": render})
    renderer = FrameRenderer(scene, work.rig, path.parent, variant, 2)
    pose = renderer.pose(replace(min(work.frame_specs, key=lambda spec: spec.index), scene=scene))
    world, line = renderer.pushed_world(pose), beam_line(renderer.rig, pose)
    s, *place = pose.state.centreline.T
    centreline = CubicSpline(s, np.transpose(place) + renderer.rig.base_position)
    knots = np.linspace(s[0], s[-1], PIECES + 1)
    controls = control_points(centreline(knots))
    halfway = (
        controls[:-3] + 23 * controls[1:-2] + 23 * controls[2:-1] + controls[3:]
    ) / 48 - centreline((knots[1:] + knots[:-1]) / 2)
    text = folder / "curve.txt"
    np.savetxt(text, np.column_stack([world.unit(controls), np.ones(len(controls))]))
    smooth = copy.copy(world)
    smooth._frozen = {}  # those of the other world render its scene
    smooth.scene = with_curve(world, text)
    rows = np.arange(world.camera.height)[:, None]
    near = np.abs(rows - line.rows) <= line.half + 1
    pixels, size = np.argwhere(near)[:, ::-1], np.full(near.sum(), SET_SIZE)
    made = np.zeros((2, pairs, *near.shape))
    for number, road in enumerate((world, smooth)):
        for pair in range(pairs):
            made[number, pair][near] = trace(
                road, pixels, size, scene_seed(100 * pair), "whole"
            ).radiance
    mesh, curve = made
    apart = float(np.linalg.norm(halfway, axis=1).max())
    return Roads(mesh, curve, line, apart / renderer.rig.beam.radius)


def with_curve(world: World, text: Path) -> Any:
    """The world's scene, in which a curve of the same paint stands in for the beam's mesh."""
    shapes = {shape.id(): shape for shape in world.scene.shapes()}
    curve = {"type": "bsplinecurve", "filename": str(text), "bsdf": shapes.pop("beam").bsdf()}
    parts = {f"part_{number}": shape for number, shape in enumerate(shapes.values())}
    return load({"type": "scene", "curve": curve, **parts})


@pytest.fixture(scope="module")
def roads(
    small_scene: Path, variant: str, tmp_path_factory: pytest.TempPathFactory
) -> Callable[[float, int], Roads]:
    if variant == PLAIN:
        pytest.skip("slow without LLVM, and the same")
    folder = tmp_path_factory.mktemp("curve")
    return lambda tolerance_px, pairs: roads_of(small_scene, variant, tolerance_px, folder, pairs)


@pytest.mark.thorough
def test_the_mesh_shows_the_smooth_beam(roads: Callable[[float, int], Roads]) -> None:
    seen = roads(0.002, 2)
    assert seen.apart < 1e-4
    mesh, curve = seen.mesh.mean(axis=0), seen.curve.mean(axis=0)
    inner = clear_columns(seen)
    assert len(inner) > 400
    moved = (seen.line.centroids(mesh, curve) - seen.line.centroids(curve, curve))[inner]
    assert abs(moved.mean()) < 2e-4
    assert np.sqrt(np.mean(moved**2)) < 0.002
    peak = np.quantile(curve[curve > 0], 0.99)
    apart = (mesh - curve)[:, inner] / peak
    assert np.sqrt(np.mean(apart[curve[:, inner] > 0] ** 2)) < 1e-3
    # A polygon inside its circle shows a little less of itself.
    assert abs(mesh[:, inner].sum() / curve[:, inner].sum() - 1) < 2e-3


@pytest.mark.thorough
def test_a_coarse_mesh_is_told_from_the_smooth_beam(roads: Callable[[float, int], Roads]) -> None:
    seen = roads(0.2, 2)
    mesh, curve = seen.mesh.mean(axis=0), seen.curve.mean(axis=0)
    inner = clear_columns(seen)
    moved = (seen.line.centroids(mesh, curve) - seen.line.centroids(curve, curve))[inner]
    assert np.sqrt(np.mean(moved**2)) > 0.004


def clear_columns(seen: Roads) -> np.ndarray:
    """Those that show the beam, without its ends."""
    curve = seen.curve.mean(axis=0)
    columns = np.flatnonzero(~np.isnan(seen.line.centroids(curve, curve)))
    first, last = columns[[0, -1]]
    return np.asarray(columns[(columns > first + ENDS_PX) & (columns < last - ENDS_PX)])
