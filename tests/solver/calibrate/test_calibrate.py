"""From drawn views to the camera."""

import math
import weakref
from collections.abc import Iterator
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from solver.calibrate import Calibration, calibrate
from solver.instrument.arrays import Floats, Grey
from solver.instrument.beam import Beam
from solver.instrument.board import Board, Charuco, Chessboard, LineNetwork
from solver.instrument.camera import Camera
from solver.instrument.errors import InputError
from solver.instrument.rig import Rig
from solver.instrument.transforms import camera_looking_at, rigid
from solver.planes.plane_c import on_plane
from tests.consistency import MOST_SIGMAS
from tests.drawn import drawn
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

TARGETS: dict[str, tuple[Board, tuple[float, ...]]] = {
    "chessboard": (Chessboard(12, 9, 0.013), ()),
    "charuco": (Charuco(10, 8, 0.015, "4x4_50"), BARREL),
    "lines": (LineNetwork(12, 10, 0.013, 0.0013), RATIONAL),
}
FIELD = 12e-3
MIDDLE = np.array([5e-3, 0.3e-3, 0.0])


def on_c(width: float, height: float, at: Floats) -> Floats:
    x, y = np.meshgrid(np.linspace(-0.5, 0.5, 9) * width, np.linspace(-0.5, 0.5, 5) * height)
    return np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)]) + at


@pytest.mark.thorough
@pytest.mark.parametrize("name", TARGETS)
def test_the_true_camera_is_found_within_its_stated_errors(name: str) -> None:
    board, lens = TARGETS[name]
    true = camera(lens)
    views = [
        drawn(
            board,
            true,
            board_pose(view),
            generator(__name__, view),
            samples=34,
            generator=21,
        )
        for view in range(4 if name == "lines" else 6)
    ]
    found = calibrate(views, rig(board, len(lens)))
    assert found.reprojection_px < 0.05
    points = on_c(0.15, 0.1, BOARD_POSE[:3, 3])
    back, _ = on_plane(found.camera, true.project(points), np.ones((len(points), 2)))
    # A thirtieth of a pixel of 0.7 mm.
    assert np.abs(back - points[:, :2]).max() < 25e-6
    assert found.covariance is not None
    sigma = np.sqrt(np.diag(found.covariance))
    assert (np.abs(pose_error(found.camera, true)) < MOST_SIGMAS * sigma[-6:]).all()
    assert abs(found.camera.fx - true.fx) < MOST_SIGMAS * sigma[0]
    again = calibrate(views, rig(board, len(lens)))
    assert again.camera.fx == found.camera.fx  # to the last bit


def micro_rig() -> Rig:
    """A pipette of 10 mm and 20 um under a microscope."""
    return replace(
        rig(Chessboard(12, 7, 0.7e-3)),
        beam=Beam(10e-3, 20e-6, 5e-10),
        antenna_from_board=rigid(np.array([0, 0, 0.01]), MIDDLE),
        telecentric=True,
    )


def microscope(lean: float) -> Camera:
    """Leaning towards the reader by `lean` [rad], rolled, its axis off the image's middle."""
    away = np.array([0.3 * math.sin(lean), -math.sin(lean), math.cos(lean)])
    pose = camera_looking_at(MIDDLE + 50e-3 * away, MIDDLE, 0.03)
    return Camera(480, 360, 480 / FIELD, 480 / FIELD, 250.2, 171.9, pose, telecentric=True)


@cache
def micro_view(lean: float) -> Grey:
    told = micro_rig()
    return drawn(
        told.board,
        microscope(lean),
        told.antenna_from_board,
        generator(__name__, 0),
        samples=34,
        generator=21,
    )


@pytest.mark.thorough
@pytest.mark.parametrize("lean_deg", [0.0, 12.0])
def test_one_view_is_enough_for_a_telecentric_camera(lean_deg: float) -> None:
    true = microscope(math.radians(lean_deg))
    found = calibrate([micro_view(math.radians(lean_deg))], micro_rig())
    assert found.camera.telecentric
    assert found.reprojection_px < 0.05
    assert found.camera.fx == pytest.approx(true.fx, rel=1e-3)
    points = on_c(10e-3, 6e-3, MIDDLE)
    back, _ = on_plane(found.camera, true.project(points), np.ones((len(points), 2)))
    assert np.abs(back - points[:, :2]).max() < 1e-4 * FIELD
    # It looks down from above, and a lean shows as itself, to what noise makes of a cosine.
    right, down, forward = found.camera.camera_from_antenna[:3, :3]
    assert np.cross(right, down) == pytest.approx(forward)
    assert forward[2] < 0
    assert forward == pytest.approx(true.camera_from_antenna[2, :3], abs=0.05)


def test_a_pinhole_needs_three_views() -> None:
    with pytest.raises(InputError, match="2 calibration views show enough of the board"):
        calibrate([micro_view(0.0)] * 2, replace(micro_rig(), telecentric=False))


@pytest.mark.parametrize(
    ("name", "said"), [("chessboard", "the whole board"), ("lines", "enough of the board")]
)
def test_a_view_without_the_board_is_refused(name: str, said: str) -> None:
    board, _ = TARGETS[name]
    with pytest.raises(InputError, match=f"plane C, does not show {said}"):
        calibrate([np.zeros((280, 320), np.uint8)], rig(board))


@pytest.mark.parametrize(
    ("columns", "rows"), [(12, 9), pytest.param(9, 6, marks=pytest.mark.thorough)]
)
def test_another_number_of_corners_is_said(columns: int, rows: int) -> None:
    board, view = (
        Chessboard(columns=columns, rows=rows, square=10e-3),
        np.full((280, 320), 200, np.uint8),
    )
    squares = np.indices((9, 12)).sum(axis=0) % 2 == 0
    view[40:220, 30:270] = np.where(np.kron(squares, np.ones((20, 20))), 30, 200)
    with pytest.raises(InputError, match="plane C, shows a board of 11 x 8 inner corners, and"):
        calibrate([view], rig(board))


def test_views_of_two_sizes_are_refused() -> None:
    views = [np.zeros((280, 320), np.uint8), np.zeros((280, 300), np.uint8)]
    with pytest.raises(InputError, match="differ in size"):
        calibrate(views, rig(TARGETS["lines"][0]))


def test_views_are_read_one_after_the_other() -> None:
    """While a view is made, no more than the one before it is still there."""
    alive: list[weakref.ref[Grey]] = []

    def views() -> Iterator[Grey]:
        for number in range(3):
            assert sum(view() is not None for view in alive) <= 1
            view = np.zeros((360, 480), np.uint8) if number else micro_view(0.0).copy()
            alive.append(weakref.ref(view))
            yield view
            del view

    assert calibrate(views(), micro_rig()).camera.telecentric
    assert len(alive) == 3


@pytest.mark.parametrize("seen", ["behind", "beside", "folded"])
def test_a_beam_that_the_camera_cannot_show_is_refused(
    seen: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    told = replace(micro_rig(), telecentric=False)
    strange = {"behind": [0, 0, 80e-3], "beside": [1e3, 0, 0], "folded": [0.2, 0, 0]}[seen]
    lens = (-0.25, 0.0, 0.0, 0.0, 0.0) if seen == "folded" else ()
    found = replace(microscope(0.0), telecentric=False, fx=2000, fy=2000, distortion=lens)
    monkeypatch.setattr("solver.calibrate.plane_alone", lambda *_: Calibration(found, 0.1))
    assert calibrate([micro_view(0.0)], told).camera is found
    with pytest.raises(InputError, match="does not show the beam"):
        calibrate([micro_view(0.0)], replace(told, base_position=np.array(strange)))
