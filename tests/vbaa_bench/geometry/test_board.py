"""What is printed on the card: the cells' meshes against the targets drawn in numpy."""

import numpy as np
import pytest
import trimesh

from solver.instrument.board import Board, Charuco, Chessboard, LineNetwork
from tests.drawn import BLACK, WHITE, reflectance
from vbaa_bench.geometry.board import board

TARGETS = pytest.mark.parametrize(
    "target",
    [
        Chessboard(6, 5, 0.02),
        Charuco(5, 4, 0.02, "4x4_50"),
        LineNetwork(6, 5, 0.02, 0.0017),
    ],
    ids=["chessboard", "charuco", "lines"],
)


@TARGETS
def test_black_and_white_cells_fill_the_card_edge_to_edge_and_face_the_viewer(
    target: Board,
) -> None:
    white, black = board(target)
    card = (target.columns + 3) * (target.rows + 3) * target.square**2
    assert white.area + black.area == pytest.approx(card, rel=1e-12)
    for cells in (white, black):
        assert cells.face_normals == pytest.approx(np.tile([0.0, 0.0, 1.0], (len(cells.faces), 1)))
        assert np.abs(np.asarray(cells.vertices)[:, 2]).max() == 0


@TARGETS
def test_the_cells_are_black_where_the_target_is(
    target: Board, random: np.random.Generator
) -> None:
    white, black = board(target)
    size = np.array([target.columns + 3, target.rows + 3]) * target.square / 2
    points = random.uniform(-size, size, (3000, 2))
    drawn = reflectance(target, points)
    assert (_lies_on(black, points) == (drawn == BLACK)).all()
    assert (_lies_on(white, points) == (drawn == WHITE)).all()


def _lies_on(cells: trimesh.Trimesh, points: np.ndarray) -> np.ndarray:
    """Whether points (n, 2) lie in a cell: cells are rectangles, two triangles each."""
    corners = np.asarray(cells.vertices)[np.asarray(cells.faces)[: len(cells.faces) // 2]][..., :2]
    low, high = corners.min(axis=1), corners.max(axis=1)
    apart = points[:, None]
    return np.asarray(((low <= apart) & (apart < high)).all(axis=2).any(axis=1))


@TARGETS
def test_the_points_are_where_the_print_says(target: Board) -> None:
    """A little way off every corner, opposite quarters look alike; about a crossing, all do."""
    points = target.corners()[:, :2]
    step = 0.06 * target.square
    quarters = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * step
    dark = reflectance(target, points[:, None] + quarters) == BLACK
    if isinstance(target, LineNetwork):
        assert (reflectance(target, points) == BLACK).all()
        plain = np.ones(len(points), bool).reshape(target.rows, target.columns)
        plain[target.thick_row] = plain[:, target.thick_column] = False
        assert not dark[plain.ravel()].any()
    else:
        assert (dark[:, 0] == dark[:, 2]).all()
        assert (dark[:, 0] != dark[:, 1]).all()
