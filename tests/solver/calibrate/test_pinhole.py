"""The bundle, on points without images."""

from collections.abc import Callable

import numpy as np
import pytest

from solver.calibrate.board_detection import BoardDetection
from solver.calibrate.calibration import Calibration
from solver.calibrate.pinhole import pinhole
from solver.instrument.arrays import Floats
from solver.instrument.board import Chessboard
from solver.instrument.camera import Camera
from solver.instrument.errors import InputError
from solver.instrument.transforms import apply
from tests.consistency import MOST_SIGMAS
from tests.draws import generator
from tests.solver.calibrate.rigs import (
    BARREL,
    BOARD_POSE,
    RATIONAL,
    board_pose,
    camera,
    pose_error,
    rig,
)

BOARD = Chessboard(12, 9, 0.014)
VIEWS = 8

Noise = Callable[[int], Floats]


def nothing(_view: int) -> Floats:
    return np.zeros((108, 2))


def found(true: Camera, noise: Noise = nothing, seen: slice = slice(None)) -> Calibration:
    numbers = np.arange(108)
    views = []
    for view in range(VIEWS):
        pixels = true.project(apply(board_pose(view), BOARD.corners())) + noise(view)
        views.append(BoardDetection(numbers[seen], pixels[seen]))
    coefficients = len(true.distortion)
    return pinhole(views, true.width, true.height, rig(BOARD, coefficients))


@pytest.mark.parametrize("lens", [(), BARREL], ids=["none", "five"])
def test_exact_points_give_the_exact_camera(lens: tuple[float, ...]) -> None:
    """Where OpenCV's own answer can be off by half a per cent (its issue 22031)."""
    true = camera(lens)
    one = found(true)
    # What is believed of coefficients pulls them by a millionth.
    assert one.camera.fx == pytest.approx(true.fx, rel=1e-5 if lens else 1e-9)
    assert one.camera.fx == one.camera.fy
    assert (one.camera.cx, one.camera.cy) == pytest.approx((true.cx, true.cy), abs=1e-3)
    assert one.reprojection_px < 1e-3
    assert np.abs(pose_error(one.camera, true)).max() < 1e-6


def test_eight_coefficients_give_the_same_image_if_not_the_same_numbers(
    random: np.random.Generator,
) -> None:
    """k1 and k4, k2 and k5 all but cancel each other: what counts is where points are seen."""
    true = camera(RATIONAL)
    one = found(true)
    pixels = random.uniform([40, 40], [280, 240], (100, 2))
    assert one.camera.normalised(pixels) == pytest.approx(true.normalised(pixels), abs=1e-5)
    assert np.abs(one.camera.distortion).max() < 1
    assert one.camera.fx == pytest.approx(true.fx, rel=1e-4)


@pytest.mark.thorough
@pytest.mark.parametrize("lens", [(), BARREL], ids=["none", "five"])
def test_the_stated_covariance_is_that_of_the_answers(
    lens: tuple[float, ...], random: np.random.Generator
) -> None:
    true = camera(lens)
    squares, distortion_squares = [], []
    for _ in range(30):
        one = found(true, lambda _: 0.02 * random.standard_normal((108, 2)))
        error = np.array(
            [
                *(one.camera.fx - true.fx, one.camera.cx - true.cx, one.camera.cy - true.cy),
                *pose_error(one.camera, true),
            ]
        )
        assert one.covariance is not None
        lens_rows = slice(3, 3 + len(lens))
        stated = np.delete(np.delete(one.covariance, lens_rows, 0), lens_rows, 1)
        squares.append(error @ np.linalg.solve(stated, error))
        distortion = np.subtract(one.camera.distortion, lens)
        sigmas = np.sqrt(np.diag(one.covariance)[lens_rows])
        distortion_squares.append(np.square(distortion / sigmas))
    # chi^2 of nine degrees of freedom, 30 draws: 9 +- 0.8.
    assert 3.8 < np.mean(squares) < 14.5
    # What is believed of k3 keeps it nearer to zero.
    assert not lens or np.mean(distortion_squares) < 2.5


def test_points_that_err_together_are_not_trusted_as_if_they_did_not() -> None:
    true = camera()
    alone, together = generator(__name__, 4), generator(__name__, 4)
    one = found(true, lambda _: 0.02 * alone.standard_normal((108, 2)))

    def by_row(_view: int) -> Floats:
        return np.repeat(0.02 * together.standard_normal((9, 2)), 12, axis=0)

    other = found(true, by_row)
    assert one.covariance is not None
    assert other.covariance is not None
    # Twelve columns err as one: sigma is up to the root of twelve larger.
    ratio = np.sqrt(np.diag(other.covariance) / np.diag(one.covariance))
    assert (ratio > 2).all()
    assert (ratio < 5.5).all()
    error = np.abs(pose_error(other.camera, true))
    assert (error < 6 * np.sqrt(np.diag(other.covariance)[-6:])).all()


def test_a_point_that_strays_is_left_out(random: np.random.Generator) -> None:
    true = camera()

    def stray(view: int) -> Floats:
        noise = 0.02 * random.standard_normal((108, 2))
        noise[17] += 3.0 if view == 2 else 0.0
        return noise

    one = found(true, stray)
    assert one.reprojection_px < 0.035
    assert one.covariance is not None
    assert abs(one.camera.fx - true.fx) < 6 * np.sqrt(one.covariance[0, 0])


def test_a_part_of_the_board_in_every_view_is_enough() -> None:
    true = camera(BARREL)
    one = found(true, seen=slice(0, 60))
    assert one.camera.cx == pytest.approx(true.cx, abs=0.01)


def test_two_views_are_too_few() -> None:
    numbers, pixels = np.arange(108), camera().project(apply(BOARD_POSE, BOARD.corners()))
    with pytest.raises(InputError, match=r"2 calibration views show enough.*needed are 3"):
        pinhole([BoardDetection(numbers, pixels)] * 2, 320, 280, rig(BOARD))


@pytest.mark.parametrize("stretch", [0.0, 0.02, -0.05])
def test_a_board_printed_too_tall_is_found(stretch: float, random: np.random.Generator) -> None:
    true, views = camera(BARREL), []
    for view in range(4):
        printed = BOARD.corners() * [1.0, 1.0 + stretch, 1.0]
        pixels = true.project(apply(board_pose(view), printed))
        views.append(BoardDetection(np.arange(108), pixels + random.normal(0, 0.03, pixels.shape)))
    found = pinhole(views, true.width, true.height, rig(BOARD, len(BARREL))).stretch
    assert found is not None
    assert abs(found.value - stretch) < MOST_SIGMAS * found.sigma
    assert found.sigma < 2e-4
    assert found.is_significant == (stretch != 0)
