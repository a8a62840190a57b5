import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from solver.instrument.arrays import Floats
from solver.instrument.rig import Chessboard
from tests.simulated import BEAM
from vbaa_bench.geometry.board import board
from vbaa_bench.geometry.objects import block, hub, sheet
from vbaa_bench.geometry.tube import arc_length_of_vertices, tube
from vbaa_bench.mechanics.planar import push
from vbaa_bench.studio import edge_of_object


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


@given(st.floats(0.02, 0.22), st.floats(0.02, 0.25))
def test_beam_and_object_touch_and_do_not_intersect(distance: float, deflection: float) -> None:
    if distance + 0.3 * deflection**2 * BEAM.length > 0.22:
        return
    state = push(BEAM, distance, deflection=deflection)
    facets = 48
    path = np.column_stack([state.centreline[:, 1:3], np.zeros(len(state.centreline))])
    mesh = tube(path, BEAM.radius, facets)
    rings = mesh.vertices[:-2].reshape(len(path), facets, 3)
    side = rings[:, facets // 2]  # the line of vertices on the object's side
    edge = edge_of_object(state)
    steps = np.diff(side[:, :2], axis=0)
    share = np.clip(((edge - side[:-1, :2]) * steps).sum(1) / (steps**2).sum(1), 0, 1)
    gaps = np.linalg.norm(side[:-1, :2] + share[:, None] * steps - edge, axis=1)
    assert gaps.min() < 1e-6  # they touch, within a micrometre
    thing = block(edge, state.pushing_angle - np.pi / 2, 0.012, -0.015, 0.0004)
    # How deep any vertex of the beam lies inside the block: below all six of its faces.
    normals, offsets = thing.face_normals, (thing.face_normals * thing.triangles[:, 0]).sum(axis=1)
    depth = (offsets - mesh.vertices @ normals.T).min(axis=1)
    assert depth.max() < 1e-6
    # The object is on the side from which it pushes: below the beam that bends up.
    assert thing.centroid[1] < np.interp(thing.centroid[0], path[:, 0], path[:, 1])


def test_solids_are_watertight_and_outward() -> None:
    for mesh, volume in (
        (block(np.array([0.1, 0.0]), -1.0, 0.012, -0.015, 0.001), 0.012**2 * 0.016),
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
