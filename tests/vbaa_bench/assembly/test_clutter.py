"""Clutter is on the table, below plane C, and in nobody's way."""

from pathlib import Path
from typing import get_args

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from solver.instrument.arrays import Floats
from solver.instrument.transforms import apply, invert
from tests.conftest import SMALL_SCENE
from tests.draws import generator
from vbaa_bench.assembly.clutter import CLUTTER, clutter_surfaces
from vbaa_bench.assembly.experiment import Experiment
from vbaa_bench.assembly.plan import plan
from vbaa_bench.geometry.clutter import Sector, Thing, thing
from vbaa_bench.scene.load import load_scene

EXTRA = """
clutter: {count: 40, size_mm: [6, 30], top_mm: -9}
background: {fixed_to: FIXED, edge: {distance_mm: 30, azimuth_deg: 70}}
object: {kind: cylinder, radius_mm: 8}
"""


@pytest.mark.false_alarm(0.0, "the values are bounded, whatever is drawn")
@pytest.mark.parametrize("kind", get_args(Thing))
@pytest.mark.parametrize("height", [1.0, 3e-3])
def test_a_thing_is_solid_and_lies_on_the_ground(kind: Thing, height: float) -> None:
    for seed in range(5):
        mesh = thing(kind, 0.03, height, generator(__name__, seed))
        assert mesh.is_watertight
        assert mesh.volume > 0
        # A polygon's lowest corner may be beside the lowest point of its circle.
        assert mesh.bounds[0, 2] == pytest.approx(0, abs=1e-5)
        assert mesh.bounds[1, 2] <= height + 1e-12
        if height > 0.03:
            across = 2 * np.linalg.norm(mesh.vertices[:, :2], axis=1).max()
            assert 0.95 * 0.03 < across < 1.5 * 0.03


@given(
    st.tuples(st.floats(-3, 3), st.floats(-3, 3)),
    st.floats(0, 1),
    st.floats(-3, 3),
    st.floats(0.01, 6.2),
)
def test_the_distance_from_a_sector(
    place: tuple[float, float], inner: float, low: float, extent: float
) -> None:
    axis = np.array([0.3, -0.2])
    sector = Sector(axis, (inner, inner + 1), (low, low + extent))
    angle, radius = np.meshgrid(
        np.linspace(low, low + extent, 1500), np.linspace(inner, inner + 1, 60)
    )
    points = axis + np.stack([radius * np.cos(angle), radius * np.sin(angle)], -1).reshape(-1, 2)
    nearest = float(np.linalg.norm(points - np.array(place), axis=1).min())
    assert sector.distance(np.array(place)) == pytest.approx(nearest, abs=0.02)


@pytest.mark.false_alarm(0.0, "the values are bounded, whatever is drawn")
@pytest.mark.parametrize("fixed_to", ["antenna", "world"])
def test_clutter_is_in_nobodys_way(fixed_to: str, tmp_path: Path) -> None:
    path = tmp_path / "scene.yaml"
    path.write_text(SMALL_SCENE + EXTRA.replace("FIXED", fixed_to), encoding="utf-8")
    file = load_scene(path)
    work = plan(file)
    surfaces = dict(clutter_surfaces(file.scene, work.rig, tmp_path))
    assert set(surfaces) == set(CLUTTER)
    parts = [p for s in surfaces.values() for p in s.mesh.split(only_watertight=False)]
    assert len(parts) > 10
    for part in parts:
        assert part.bounds[0, 2] == pytest.approx(-0.030, abs=1e-5)
        assert part.bounds[1, 2] <= -0.009 + 1e-9
    # Their reflectances are those of the section.
    for surface in surfaces.values():
        assert surface.texture is not None
        assert 0.04 <= surface.texture.image.min() <= surface.texture.image.max() <= 0.5
    normal = np.array([np.cos(np.deg2rad(70)), np.sin(np.deg2rad(70))])
    for spec in work.frame_specs:
        experiment = Experiment(file.scene, work.rig, spec.push, tmp_path)
        state = experiment.states()[spec.step]
        ground_from_clamp = np.eye(4)
        if fixed_to == "world":
            motor_angle = spec.motor_angle(state.pushing_angle)
            ground_from_clamp = invert(experiment.clamp_from_world(motor_angle))
        touched = np.asarray(experiment.touched_mesh(state, spec.step).vertices)
        block = _hull(apply(ground_from_clamp, touched))
        line = apply(ground_from_clamp, state.centreline[:, 1:])[:, :2]
        for part in parts:
            outline = _hull(np.asarray(part.vertices))
            area, _ = cv2.intersectConvexConvex(block, outline)
            assert area == 0
            over = [cv2.pointPolygonTest(outline, (float(x), float(y)), False) for x, y in line]
            assert max(over) < 0
            assert ((part.vertices[:, :2] - [0.12, 0.0]) @ normal).max() <= 0.030 + 1e-9


def _hull(points: Floats) -> np.ndarray:
    return np.asarray(cv2.convexHull(points[:, :2].astype(np.float32)))
