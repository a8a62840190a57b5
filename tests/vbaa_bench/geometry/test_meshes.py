import numpy as np
import pytest

from solver.instrument.arrays import Floats
from solver.instrument.board import Chessboard
from vbaa_bench.geometry.board import board, squares
from vbaa_bench.geometry.objects import block, hub, sheet
from vbaa_bench.geometry.tube import arc_length_of_vertices, tube


def helix(n: int = 400) -> Floats:
    t = np.linspace(0, 4 * np.pi, n)
    return np.column_stack([0.01 * t, 0.02 * np.cos(t), 0.02 * np.sin(t)])


@pytest.mark.parametrize(
    "path", [helix(), np.column_stack([np.linspace(0, 0.24, 200)] + [np.zeros(200)] * 2)]
)
def test_a_tube_is_closed_outward_and_of_the_right_volume(path: Floats) -> None:
    radius, facets = 0.4e-3, 48
    mesh = tube(path, radius, facets)
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    length = np.linalg.norm(np.diff(path, axis=0), axis=1).sum()
    polygon = facets / 2 * radius**2 * np.sin(2 * np.pi / facets)
    assert mesh.volume == pytest.approx(polygon * length, rel=2e-3)
    distance = np.linalg.norm(
        mesh.vertices[:-2].reshape(len(path), facets, 3) - path[:, None], axis=2
    )
    assert distance == pytest.approx(radius, rel=1e-9)


def test_every_vertex_knows_its_arc_length() -> None:
    s = np.linspace(0, 0.24, 30)
    path = np.column_stack([s, np.zeros(30), np.zeros(30)])
    found = arc_length_of_vertices(s, 12)
    assert found == pytest.approx(tube(path, 1e-3, 12).vertices[:, 0], abs=1e-12)


def test_solids_are_watertight_and_outward() -> None:
    for mesh, volume in (
        (block(0.012, -0.015, 0.001), 0.012**2 * 0.016),
        (hub(0.003, -0.02, 0.002), np.pi * 0.003**2 * 0.022),
    ):
        assert mesh.is_watertight
        assert mesh.volume == pytest.approx(volume, rel=0.01)
    assert sheet(np.zeros(3), 1.0, 1).face_normals[:, 2] == pytest.approx(1)
    assert sheet(np.zeros(3), 1.0, -1).face_normals[:, 2] == pytest.approx(-1)


def test_the_board_has_its_corners_where_the_rig_says() -> None:
    card = Chessboard(6, 5, 0.02)
    white, black = board(card)
    assert white.area + black.area == pytest.approx(9 * 8 * 0.02**2)
    assert black.area == pytest.approx(7 * 6 / 2 * 0.02**2)
    used = black.vertices[np.unique(black.faces)]
    for corner in card.corners():  # every inner corner is a corner of a black square
        assert np.linalg.norm(used - corner, axis=1).min() < 1e-12
    assert (white.face_normals[:, 2] > 0.99).all()
    assert (black.face_normals[:, 2] > 0.99).all()


def test_a_chequered_ground_has_as_much_of_both() -> None:
    light, dark = squares(0.6, 0.05)
    assert light.area == pytest.approx(0.18)
    assert dark.area == pytest.approx(0.18)
    assert np.vstack([light.vertices, dark.vertices]).mean(axis=0) == pytest.approx(0, abs=1e-12)
    assert (dark.face_normals[:, 2] > 0.99).all()
