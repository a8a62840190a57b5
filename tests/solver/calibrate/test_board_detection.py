"""Points of each target, drawn in numpy, lie where they are found, and are the ones they are."""

import math
from dataclasses import replace

import numpy as np
import pytest

from solver.calibrate import detect_board
from solver.calibrate.saddles import _Markers, _other_charuco
from solver.instrument.arrays import Floats
from solver.instrument.board import Board, Charuco, Chessboard, LineNetwork
from solver.instrument.camera import Camera
from solver.instrument.errors import InputError
from solver.instrument.transforms import apply, camera_looking_at, rigid
from tests.drawn import OldCharuco, drawn, tilted
from tests.draws import generator

SQUARE = 0.014
BOARDS: dict[str, Board] = {
    "chessboard": Chessboard(10, 7, SQUARE),
    "charuco": Charuco(10, 8, SQUARE, "4x4_50"),
    "lines": LineNetwork(10, 8, SQUARE, 0.0013),
}
# Of noise and of the pixel grid, over all points of a view; lines are averaged along.
RMS_PX = {"chessboard": 0.036, "charuco": 0.036, "lines": 0.024}
# Subpixels and their lattice, where a point may be some hundredths of a pixel off.
COARSE = (21, 13)
MIDDLE = rigid(np.zeros(3), np.array([0.12, 0.018, 0.0]))


def camera(roll_deg: float = 1.0) -> Camera:
    pose = camera_looking_at(
        np.array([0.12, 0.018, 0.36]), np.array([0.1206, 0.02, 0.0]), math.radians(roll_deg)
    )
    return Camera(320, 280, 560, 560, 158.3, 141.2, pose, distortion=(-0.2, 0.08, 0.001, -7e-4, 0))


def errors(name: str, seen_by: Camera, pose: Floats, samples: tuple[int, int] = COARSE) -> Floats:
    """How far (n, 2) [px] the points of a view are found from where they are."""
    board = BOARDS[name]
    random = generator(__name__, 0)
    view = drawn(board, seen_by, pose, random, samples=samples[0], generator=samples[1])
    found = detect_board(view, board)
    assert found is not None
    assert len(found) > 0.5 * board.columns * board.rows
    return found.pixels - seen_by.project(apply(pose, board.corners()))[found.numbers]


@pytest.mark.thorough
@pytest.mark.parametrize("name", BOARDS)
@pytest.mark.parametrize("number", [0, 1])
def test_points_lie_where_they_are_drawn(name: str, number: int) -> None:
    pose = tilted(MIDDLE, number, 0.02, 0.4 * number)
    error = errors(name, camera(), pose, samples=(55, 34))
    assert np.sqrt((error**2).sum(axis=1).mean()) < RMS_PX[name]
    # The light falls off by a fifth across the view.
    assert np.abs(error.mean(axis=0)).max() < 0.018


@pytest.mark.thorough
@pytest.mark.parametrize("name", BOARDS)
@pytest.mark.parametrize("roll_deg", [-40.0, 40.0])
def test_a_turned_board_is_not_taken_for_another(name: str, roll_deg: float) -> None:
    away = 0.1 if name == "chessboard" else 0.02  # it must be seen whole
    assert np.abs(errors(name, camera(roll_deg), tilted(MIDDLE, 0, away, 0.2))).max() < 0.3


@pytest.mark.parametrize("name", ["chessboard", "charuco"])
@pytest.mark.parametrize(
    "roll_deg", [pytest.param(-130.0, marks=pytest.mark.thorough), 90.0, 180.0]
)
def test_the_pattern_shows_any_roll(name: str, roll_deg: float) -> None:
    away = 0.1 if name == "chessboard" else 0.02
    assert np.abs(errors(name, camera(roll_deg), tilted(MIDDLE, 0, away, 0.2))).max() < 0.3


@pytest.mark.thorough
@pytest.mark.parametrize(("roll_deg", "quarter_turns"), [(100.0, 1), (180.0, 2), (-75.0, 3)])
def test_lines_need_the_nearest_quarter_turn(
    roll_deg: float, quarter_turns: int, random: np.random.Generator
) -> None:
    """The camera's roll turns the board the other way in the image."""
    board, seen_by = BOARDS["lines"], camera(roll_deg)
    pose = tilted(MIDDLE, 0, 0.02, 0.2)
    view = drawn(board, seen_by, pose, random, samples=21, generator=13)
    expected = seen_by.project(apply(pose, board.corners()))
    errors = []
    for turns in (quarter_turns, quarter_turns + 2):
        found = detect_board(view, board, turns)
        assert found is not None
        errors.append(np.abs(found.pixels - expected[found.numbers]).max())
    assert min(errors) < 0.3
    assert max(errors) > 10


@pytest.mark.thorough
@pytest.mark.parametrize("name", ["charuco", "lines"])
@pytest.mark.parametrize("aside", [(0.04, 0.02), (-0.04, -0.03)])
def test_a_part_of_the_board_is_enough(name: str, aside: tuple[float, float]) -> None:
    pose = MIDDLE.copy()
    pose[:2, 3] += aside
    assert np.abs(errors(name, camera(), pose)).max() < 0.3


@pytest.mark.thorough
@pytest.mark.parametrize("name", BOARDS)
def test_sixteen_bits_are_all_used(name: str, random: np.random.Generator) -> None:
    """A dim view of 12 bits in 16, without noise: in 8 bits its steps would be noise."""
    board = BOARDS[name]
    seen_by = replace(camera(), distortion=())
    deep = drawn(board, seen_by, MIDDLE, random, noise=0, bits=16, samples=21, generator=13)
    full, dim = detect_board(deep, board), detect_board(deep // 16, board)
    assert full is not None
    assert dim is not None
    assert np.array_equal(full.numbers, dim.numbers)
    assert np.abs(full.pixels - dim.pixels).max() < 0.002


@pytest.mark.parametrize("name", BOARDS)
@pytest.mark.parametrize("what", ["nothing", "noise"])
def test_where_there_is_no_board_none_is_seen(
    name: str, what: str, random: np.random.Generator
) -> None:
    blank = np.zeros((280, 320), np.uint8)
    if what == "noise":
        blank = random.integers(0, 255, blank.shape, dtype=np.uint8)
    assert detect_board(blank, BOARDS[name]) is None


@pytest.mark.parametrize("kind", [Charuco, OldCharuco])
def test_a_board_with_markers_is_read_in_either_layout_and_never_mirrored(
    kind: type[Charuco], random: np.random.Generator
) -> None:
    """With an even number of rows of squares, OpenCV before 4.6 printed other colours."""
    board = kind(10, 7, SQUARE, "4x4_50")
    view = drawn(board, camera(), MIDDLE, random, samples=21, generator=13)
    found = detect_board(view, Charuco(10, 7, SQUARE, "4x4_50"))
    assert found is not None
    assert len(found) > 0.8 * 70
    errors = found.pixels - camera().project(apply(MIDDLE, board.corners()))[found.numbers]
    assert np.abs(errors).max() < 0.3
    for mirrored in (view[:, ::-1], view[::-1]):
        with pytest.raises(InputError, match="the images are mirrored: the board's markers"):
            detect_board(np.ascontiguousarray(mirrored), board)


@pytest.mark.parametrize(
    ("columns", "rows"),
    [
        (8, 10),
        (10, 6),
        # The search for the number of columns does not depend on the stated one.
        pytest.param(11, 8, marks=pytest.mark.thorough),
        pytest.param(9, 8, marks=pytest.mark.thorough),
        pytest.param(12, 6, marks=pytest.mark.thorough),
    ],
)
def test_markers_show_a_board_of_another_size(
    columns: int, rows: int, random: np.random.Generator
) -> None:
    view = drawn(
        Charuco(10, 8, SQUARE, "4x4_100"), camera(), MIDDLE, random, samples=21, generator=13
    )
    with pytest.raises(InputError, match="markers of a board of 10 x 8 inner corners or more"):
        detect_board(view, Charuco(columns, rows, SQUARE, "4x4_100"))


@pytest.mark.parametrize("columns", [7, 10, 11, 14])
def test_markers_of_two_rows_show_no_other_board(columns: int) -> None:
    numbers = np.arange(8)
    board = Charuco(columns, 6, SQUARE, "4x4_100")
    row, column = np.divmod(2 * numbers + 1, 11)
    centres = 20.0 * np.column_stack([column, row]) + [30.0, 40.0]
    assert _other_charuco(_Markers(numbers, centres), board, seen=False) == ""


def test_rows_that_the_view_does_not_show_may_exist(random: np.random.Generator) -> None:
    """Of a board of the layout before OpenCV 4.6 their number decides about the colours."""
    stated = Charuco(10, 8, SQUARE, "4x4_100")
    for kind, readable in ((Charuco, True), (OldCharuco, False)):
        board = kind(10, 7, SQUARE, "4x4_100")
        view = drawn(board, camera(), MIDDLE, random, samples=21, generator=13)
        if readable:
            found = detect_board(view, stated)
            assert found is not None
            assert found.numbers.max() < 70
        else:
            with pytest.raises(InputError, match="markers of a board of 10 x 7 inner corners"):
                detect_board(view, stated)
