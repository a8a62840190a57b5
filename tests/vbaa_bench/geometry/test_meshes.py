import numpy as np
import pytest

from solver.instrument.arrays import Floats
from solver.instrument.board import Chessboard
from vbaa_bench.geometry.board import board
from vbaa_bench.geometry.clamp import hub
from vbaa_bench.geometry.sheets import sheet, squares
from vbaa_bench.geometry.tube import arc_length_of_vertices, normals, sides, tube
from vbaa_bench.scene.objects.block import block


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


def test_caps_apart_are_those_of_a_closed_tube() -> None:
    closed, apart = tube(helix(), 1e-3, 12), tube(helix(), 1e-3, 12, caps_apart=True)
    assert np.allclose(apart.triangles, closed.triangles, atol=0)
    assert not apart.is_watertight
    apart.merge_vertices()
    assert apart.is_watertight


@pytest.mark.parametrize("count", [100, 400])
def test_normals_of_a_tube_point_from_its_centreline(count: int) -> None:
    path, facets = helix(count), 24
    mesh = tube(path, 0.4e-3, facets, caps_apart=True)
    found = normals(np.asarray(mesh.vertices), facets)
    radial = (sides(mesh.vertices, facets) - path[:, None]) / 0.4e-3
    error = sides(found, facets) - radial
    # Chords at the ends; elsewhere the error falls with the square of the spacing.
    assert np.abs(error[1:-1]).max() < 30 / count**2
    caps = found[len(path) * facets :]
    tangent = np.gradient(path, axis=0)[[0, -1]]
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    assert (caps[:facets] @ -tangent[0] > 0.999).all()
    assert (caps[facets : 2 * facets] @ tangent[1] > 0.999).all()
    assert np.linalg.norm(found, axis=1) == pytest.approx(1)


def test_normals_of_a_taper_lean_along_it() -> None:
    path = np.column_stack([np.linspace(0, 0.24, 50), np.zeros(50), np.zeros(50)])
    mesh = tube(path, np.linspace(2e-3, 1e-3, 50), 16, caps_apart=True)
    found = sides(normals(np.asarray(mesh.vertices), 16), 16)
    lean = 1e-3 / 0.24
    # The sides of a polygon are nearer to the axis than its corners, and lean less.
    assert found[..., 0] == pytest.approx(lean / np.hypot(1, lean), rel=1e-6)


def test_every_vertex_knows_its_arc_length() -> None:
    s = np.linspace(0, 0.24, 30)
    path = np.column_stack([s, np.zeros(30), np.zeros(30)])
    found = arc_length_of_vertices(s, 12)
    apart = tube(path, 1e-3, 12, caps_apart=True)
    assert found == pytest.approx(apart.vertices[:, 0], abs=1e-12)


def test_solids_are_watertight_and_outward() -> None:
    for mesh, volume in (
        (block(0.012, -0.015, 0.001), 0.012**2 * 0.016),
        # Less four prisms under the slopes, which overlap in the corners: c^2 s / 2, c^3 / 3.
        (block(0.012, -0.015, 0.003, 0.002), 0.012**2 * 0.018 - 0.002**2 * (0.024 - 0.008 / 3)),
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
