"""The squares of a ground lie where the scene states, fill the image, and are resolved."""

from pathlib import Path

import numpy as np
import pytest

from solver.instrument.errors import InputError
from solver.instrument.transforms import apply
from tests.conftest import SMALL_SCENE
from vbaa_bench.assembly.ground import Ground, ground_setting, view_of_ground
from vbaa_bench.assembly.plan import plan
from vbaa_bench.scene.background import MAX_SQUARES, Squares
from vbaa_bench.scene.load import SceneFile, load_scene
from vbaa_bench.scene.rigs import true_rig


def scene_of(folder: Path, background: str, *changes: tuple[str, str]) -> SceneFile:
    text = SMALL_SCENE + f"background: {{pattern: squares, {background}}}\n"
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    path = folder / "scene.yaml"
    path.write_text(text, encoding="utf-8")
    return load_scene(path)


def side_in_view(file: SceneFile) -> float:
    return ground_setting(file.scene, true_rig(file.scene)).view


def ground(folder: Path, keys: str) -> Ground:
    scene = scene_of(folder, f"square_mm: 20{keys}").scene
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


@pytest.mark.parametrize("square_mm", [0.001, 0.1, 0.5])
def test_squares_that_no_camera_resolves_are_refused(tmp_path: Path, square_mm: float) -> None:
    file = scene_of(tmp_path, f"square_mm: {square_mm}")
    with pytest.raises(InputError) as caught:
        plan(file)
    (message,) = str(caught.value).splitlines()
    said = rf"background.square_mm is {square_mm:g}, allowed is >= 1.11: smaller squares are below"
    assert said in message


def test_squares_that_are_resolved_are_few_enough(tmp_path: Path) -> None:
    file = scene_of(tmp_path, "square_mm: 1.2")
    plan(file)
    # 176 rows and 512 columns, of two pixels each, and what is beyond a corner.
    assert side_in_view(file) / 1.2e-3 < 350
    large = scene_of(tmp_path, "square_mm: 5", ("width_px: 512", "width_px: 8192"))
    setting = ground_setting(large.scene, true_rig(large.scene))
    assert setting.view / Squares(large.scene.background).finest(setting) <= MAX_SQUARES


@pytest.mark.parametrize("fixed_to", ["antenna", "world"])
@pytest.mark.parametrize("tilted", [False, True])
def test_the_ground_fills_the_image_however_it_is_turned(
    tmp_path: Path, fixed_to: str, tilted: bool
) -> None:
    changes = [("[120.0, 22.0, 360.0]", "[80.0, -120.0, 300.0]")] if tilted else []
    file = scene_of(tmp_path, f"square_mm: 15, fixed_to: {fixed_to}", *changes)
    camera = true_rig(file.scene).camera
    half = side_in_view(file) / 2
    signs = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    corners = np.array([0.12, 0.0]) + half * signs
    for angle in np.radians([0, 30, 45, 180, 250] if fixed_to == "world" else [0]):
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        turned = np.column_stack([corners @ turn.T, np.full(4, -0.03)])
        assert apply(camera.camera_from_antenna, turned)[:, 2].min() > 0
        pixels = camera.project(turned)
        along = np.roll(pixels, -1, axis=0) - pixels
        for u, v in [(-0.5, -0.5), (511.5, -0.5), (511.5, 175.5), (-0.5, 175.5)]:
            away = np.array([u, v]) - pixels
            side = along[:, 0] * away[:, 1] - along[:, 1] * away[:, 0]
            assert (side < 0).all()


def test_a_camera_that_sees_the_horizon_has_a_ground_of_its_own_size(tmp_path: Path) -> None:
    far = [("[120.0, 22.0, 360.0]", "[120.0, -900.0, 50.0]")]
    file = scene_of(tmp_path, "square_mm: 15", *far)
    assert side_in_view(file) == pytest.approx(6 * 0.24)
