"""The squares of a ground lie where the scene states, and fill the image."""

from pathlib import Path

import numpy as np
import pytest

from tests.conftest import SMALL_SCENE
from vbaa_bench.assembly.ground import Ground
from vbaa_bench.assembly.ground_view import view_of_ground
from vbaa_bench.scene.load import load_scene
from vbaa_bench.scene.rigs import true_rig


def ground(folder: Path, keys: str) -> Ground:
    path = folder / "scene.yaml"
    squares = f"background: {{pattern: squares, square_mm: 20{keys}}}\n"
    path.write_text(SMALL_SCENE + squares, encoding="utf-8")
    scene = load_scene(path).scene
    return Ground(scene, true_rig(scene), folder)


@pytest.mark.parametrize("turn", [0.0, 30.0, -45.0])
@pytest.mark.parametrize("offset", [(0.0, 0.0), (13.0, -7.0), (93.0, -87.0)])
def test_squares_are_turned_and_offset(
    tmp_path: Path, turn: float, offset: tuple[float, float]
) -> None:
    keys = f", square_offset_mm: [{offset[0]}, {offset[1]}], square_turn_deg: {turn}"
    made = ground(tmp_path, keys)
    corner = np.array([made.rig.beam.length / 2, 0.0]) + 1e-3 * np.array(offset)
    low, high = view_of_ground(made.scene, made.rig.camera)
    view = np.array([low, high, [low[0], high[1]], [high[0], low[1]]])
    axis = np.array([np.cos(np.radians(turn)), np.sin(np.radians(turn))])
    across = np.array([-axis[1], axis[0]])
    for _, surface in made.surfaces():
        vertices = np.asarray(surface.mesh.vertices)
        assert np.allclose(vertices[:, 2], -0.030)
        # All corners are whole squares from the place that is stated, along the turned axes.
        for direction in (axis, across):
            squares = (vertices[:, :2] - corner) @ direction / 0.020
            assert np.abs(squares - np.round(squares)).max() < 1e-6
            seen = (view - corner) @ direction / 0.020
            assert squares.min() < seen.min()
            assert seen.max() < squares.max()


def test_without_offset_an_edge_is_below_the_beam(tmp_path: Path) -> None:
    (_, light), (_, dark) = ground(tmp_path, "").surfaces()
    for surface in (light, dark):
        assert np.abs(np.asarray(surface.mesh.vertices)[:, 1]).min() < 1e-12
