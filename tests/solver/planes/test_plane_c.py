import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from solver.instrument.camera import Camera
from solver.instrument.errors import InputError
from solver.instrument.transforms import apply, camera_looking_at, invert, rigid, turn_about_z
from solver.planes.plane_c import on_plane
from tests.draws import generator


def camera() -> Camera:
    pose = camera_looking_at(np.array([0.12, 0.02, 0.36]), np.array([0.125, 0.01, 0.0]), 0.02)
    return Camera(512, 400, 700, 700, 250.0, 205.0, pose)


def distorting() -> Camera:
    lens = (0.1, 0.02, -0.001, 0.0008, 0.005, 0.28, 0.03, 0.01)
    return replace(camera(), distortion=lens)


def microscope() -> Camera:
    pose = camera_looking_at(np.array([0.005, -0.004, 0.05]), np.array([0.005, 0.0, 0.0]), 0.02)
    return Camera(512, 400, 5e4, 5e4, 250.0, 205.0, pose, telecentric=True)


@pytest.mark.parametrize("camera", [camera(), distorting()], ids=["pinhole", "distorting"])
def test_points_on_the_plane_come_back(camera: Camera, random: np.random.Generator) -> None:
    points = np.column_stack([random.uniform(0, 0.24, 50), random.uniform(-0.05, 0.05, 50)])
    pixels = camera.project(np.column_stack([points, np.zeros(50)]))
    found, _ = on_plane(camera, pixels, np.ones((50, 2)))
    assert found == pytest.approx(points, abs=1e-15)


@given(
    lean=st.floats(-0.6, 0.6),
    compass=st.floats(0, 2 * math.pi),
    roll=st.floats(-0.7, 0.7),
    field=st.floats(1e-5, 1.0),
    telecentric=st.booleans(),
)
def test_both_projections_come_back_whatever_the_pose_and_the_size(
    lean: float, compass: float, roll: float, field: float, telecentric: bool
) -> None:
    away = np.array(
        [math.sin(lean) * math.cos(compass), math.sin(lean) * math.sin(compass), math.cos(lean)]
    )
    target = np.array([0.5, 0.1, 0.0]) * field
    pose = camera_looking_at(target + 2 * field * away, target, roll)
    focal = 512 / field if telecentric else 1024.0
    leaning = Camera(512, 400, focal, focal, 250.0, 205.0, pose, telecentric)
    points = generator(__name__, 0).uniform(0, field, (20, 2))
    pixels = leaning.project(np.column_stack([points, np.zeros(20)]))
    found, _ = on_plane(leaning, pixels, np.ones((20, 2)))
    assert found == pytest.approx(points, abs=1e-12 * field)


@pytest.mark.parametrize(
    "camera",
    [camera(), distorting(), microscope()],
    ids=["pinhole", "distorting", "telecentric"],
)
def test_sigma_vectors_are_the_derivative_by_the_image_row(camera: Camera) -> None:
    pixels, step = np.array([[30.0, 200.0], [400.0, 90.0]]), 1e-4
    _, vectors = on_plane(camera, pixels, np.array([[0.0, 1.0], [0.0, 2.0]]))
    down = np.array([0.0, step])
    ahead, _ = on_plane(camera, pixels + down, np.ones((2, 2)))
    behind, _ = on_plane(camera, pixels - down, np.ones((2, 2)))
    slope = (ahead - behind) / (2 * step)
    assert vectors == pytest.approx(slope * [[1.0], [2.0]], rel=1e-7)


def test_depth_does_not_move_a_point_in_a_telecentric_image() -> None:
    pose = microscope().camera_from_antenna
    points = np.array([[0.002, 0.001, 0.0], [0.008, -0.001, 0.0003]])
    nearer = points - 0.02 * pose[2, :3]
    assert microscope().project(nearer) == pytest.approx(microscope().project(points), abs=1e-9)
    assert np.abs(camera().project(nearer) - camera().project(points)).max() > 1


@pytest.mark.parametrize("camera", [camera(), microscope()], ids=["pinhole", "telecentric"])
def test_pixels_per_metre_is_how_far_a_step_across_the_axis_moves_a_point(camera: Camera) -> None:
    points, step = np.array([[0.002, 0.001, 0.0], [0.008, -0.001, 0.0003]]), 1e-6
    right = camera.camera_from_antenna[0, :3]
    moved = camera.project(points + step * right) - camera.project(points)
    assert camera.pixels_per_metre(points) == pytest.approx(moved[:, 0] / step, rel=1e-6)


def test_the_camera_sees_x_to_the_right_and_y_up() -> None:
    origin, right, up = camera().project(np.array([[0.1, 0, 0], [0.11, 0, 0], [0.1, 0.01, 0]]))
    assert right[0] > origin[0] + 10
    assert up[1] < origin[1] - 10


def test_transforms_invert_and_turn(random: np.random.Generator) -> None:
    pose = rigid(np.array([0.3, -0.2, 0.5]), np.array([1.0, 2.0, 3.0]))
    points = random.standard_normal((5, 3))
    assert apply(invert(pose), apply(pose, points)) == pytest.approx(points)
    quarter = apply(turn_about_z(np.pi / 2), np.array([[1.0, 0.0, 5.0]]))
    assert quarter == pytest.approx(np.array([[0.0, 1.0, 5.0]]))
    with pytest.raises(ValueError, match="along the beam"):
        camera_looking_at(np.zeros(3), np.array([1.0, 0, 0]), 0.0)


def test_a_pixel_beyond_the_lens_model_is_refused() -> None:
    folded = replace(camera(), distortion=(-0.3, 0.0, 0.0, 0.0, 0.0))
    pixels = np.array([[250.0, 205.0], [5000.0, 205.0]])
    with pytest.raises(InputError, match=r"\(5000, 205\) is outside the field of the distortion"):
        on_plane(folded, pixels, np.zeros((2, 2)))
