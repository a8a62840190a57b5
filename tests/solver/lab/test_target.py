"""The printed board is the one that calibration looks for."""

import re

import numpy as np
import pytest

from solver.calibrate import detect_board
from solver.instrument.arrays import Grey
from solver.instrument.board import Board, Charuco, Chessboard, LineNetwork
from solver.lab.target import black_rectangles, svg

BOARDS = [
    Chessboard(7, 5, 0.02),
    Charuco(7, 5, 0.02, "4x4_50"),
    LineNetwork(7, 5, 0.02, 0.002),
]
PX_PER_MM = 5


def printed(board: Board) -> Grey:
    """The card as a picture, read from the SVG's own numbers."""
    text = svg(board)
    width, height = ((count + 3) * 20 * PX_PER_MM for count in (board.columns, board.rows))
    card = np.full((height, width), 230, np.uint8)
    number = r'"([\d.]+)"'
    for found in re.findall(rf"<rect x={number} y={number} width={number} height={number}/>", text):
        x, y, w, h = (round(float(value) * PX_PER_MM) for value in found)
        card[y : y + h, x : x + w] = 10
    return card


@pytest.mark.thorough
@pytest.mark.parametrize("board", BOARDS, ids=lambda board: type(board).__name__)
def test_the_print_is_found_where_it_was_drawn(board: Board) -> None:
    card = printed(board)
    seen = detect_board(np.pad(card, 60, constant_values=60), board)
    assert seen is not None
    assert len(seen) == board.columns * board.rows
    # The card's middle is the pattern's; x to the right, y up, in pixels of integer centres.
    middle = (np.array(card.shape[::-1]) - 1) / 2 + 60
    expected = middle + board.corners()[seen.numbers, :2] * [1, -1] * 1e3 * PX_PER_MM
    assert np.abs(seen.pixels - expected).max() < 0.1


@pytest.mark.parametrize("board", BOARDS, ids=lambda board: type(board).__name__)
def test_it_prints_in_its_true_size(board: Board) -> None:
    text = svg(board)
    assert 'width="200.0000mm" height="172.0000mm" viewBox="0 0 200.0000 172.0000"' in text
    assert "100 mm: measure it" in text
    rectangles = black_rectangles(board)
    # Inked is nothing within a square of the card's rim.
    assert rectangles[:, :2].min() >= 0.02 - 1e-12
    ends = rectangles[:, :2] + rectangles[:, 2:]
    assert (ends.max(axis=0) <= np.array([0.2, 0.16]) - 0.02 + 1e-12).all()
