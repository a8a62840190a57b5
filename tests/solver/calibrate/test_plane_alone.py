import numpy as np
import pytest

from solver.calibrate import calibrate
from solver.calibrate.board_detection import BoardDetection
from solver.calibrate.pinhole import plane_alone
from solver.instrument.board import Chessboard
from solver.instrument.camera import Camera
from solver.instrument.errors import InputError
from solver.instrument.transforms import camera_looking_at
from solver.planes.plane_c import on_plane
from tests.drawn import drawn
from tests.solver.calibrate.rigs import BOARD_POSE, board_pose, camera, rig

BOARD = Chessboard(12, 9, 0.013)
OBLIQUE = Camera(
    320,
    280,
    480.0,
    480.0,
    158.0,
    141.0,
    camera_looking_at(np.array([0.05, -0.12, 0.33]), np.array([0.12, 0.02, 0.0]), 0.05),
)


@pytest.mark.parametrize("true", [camera(), OBLIQUE], ids=["from above", "aslant"])
def test_one_view_tells_plane_c_and_says_that_it_tells_no_viewpoint(
    true: Camera, random: np.random.Generator
) -> None:
    view = drawn(BOARD, true, BOARD_POSE, random, samples=34, generator=21)
    found = calibrate([view], rig(BOARD))
    assert not found.viewpoint_known
    assert found.reprojection_px < 0.05
    x, y = np.meshgrid(np.linspace(0.05, 0.19, 9), np.linspace(-0.03, 0.06, 5))
    points = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    back, _ = on_plane(found.camera, true.project(points), np.zeros((len(points), 2)))
    assert np.abs(back - points[:, :2]).max() < 2e-5  # a thirtieth of a pixel


def test_a_lens_that_distorts_needs_more_views(random: np.random.Generator) -> None:
    view = drawn(BOARD, camera(), board_pose(0), random, samples=34, generator=21)
    with pytest.raises(InputError, match="a single view works with 0 camera"):
        calibrate([view], rig(BOARD, 5))


def test_a_board_seen_as_one_point_determines_no_camera(random: np.random.Generator) -> None:
    count = BOARD.rows * BOARD.columns
    seen = BoardDetection(np.arange(count), 100 + 1e-9 * random.standard_normal((count, 2)))
    with pytest.raises(InputError, match="do not determine the camera"):
        plane_alone(seen, 320, 280, rig(BOARD))
