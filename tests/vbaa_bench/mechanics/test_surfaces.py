"""Edges and corners of meshes: distances, and which of them a beam touches."""

from itertools import pairwise

import numpy as np
import pytest
import trimesh
from scipy.optimize import lsq_linear

from solver.instrument.transforms import rigid
from tests.vbaa_bench.mechanics.benches import BEAM
from vbaa_bench.mechanics.surfaces import Line, Solid, _closest_approach


def test_distance_from_a_box_is_that_from_its_nearest_edge(random: np.random.Generator) -> None:
    half, middle = np.array([0.01, 0.02, 0.05]), np.array([0.02, -0.03, 0.01])
    mesh = trimesh.creation.box(2 * half)
    mesh.apply_transform(rigid([0.3, -0.2, 0.5], middle))
    solid = Solid(mesh)
    turn = rigid([0.3, -0.2, 0.5], middle)[:3, :3]
    for _ in range(100):
        place = random.uniform(-0.1, 0.1, 3)
        distance, direction = solid.distance(middle + turn @ place)
        # On an edge along an axis, the nearest point differs from the place by a clip on that axis.
        inside = np.clip(place, -half, half)
        ends = np.copysign(half, place)
        edges = [np.where(np.arange(3) == axis, inside, ends) for axis in range(3)]
        nearest = min(edges, key=lambda point: float(np.linalg.norm(place - point)))
        assert abs(distance) == pytest.approx(np.linalg.norm(place - nearest), abs=1e-12)
        assert distance * direction == pytest.approx(turn @ (place - nearest), abs=1e-12)


def test_closest_approach_of_an_edge_and_a_polyline_is_the_bounded_least_squares(
    random: np.random.Generator,
) -> None:
    for _ in range(200):
        first, last, *line = random.uniform(-1.0, 1.0, (5, 3))
        distance, fraction = _closest_approach(first, last, np.array(line))
        steps = [
            lsq_linear(
                np.column_stack([last - first, start - end]), start - first, (0, 1), tol=1e-14
            )
            for start, end in pairwise(line)
        ]
        best = min(steps, key=lambda solution: float(solution.cost))
        assert distance == pytest.approx(np.sqrt(2 * best.cost), abs=1e-9)
        assert fraction == pytest.approx(best.x[0], abs=1e-6)


def test_closest_approach_of_two_segments_is_symmetric(random: np.random.Generator) -> None:
    for _ in range(200):
        one, other = random.uniform(-1.0, 1.0, (2, 2, 3))
        distance, _ = _closest_approach(one[0], one[1], other)
        assert _closest_approach(other[0], other[1], one)[0] == pytest.approx(distance, abs=1e-12)


def test_of_two_edges_at_once_the_one_nearer_to_the_clamp_is_touched(
    random: np.random.Generator,
) -> None:
    """A beam along the top face of a sheared box, whatever the numbering of the vertices."""
    mesh = trimesh.creation.box((0.02, 0.02, 0.02))
    shear = np.eye(4)
    shear[0, 2] = 2.5
    mesh.apply_transform(shear)
    x = np.linspace(-0.1, 0.1, 41)
    line = np.column_stack([x, np.full_like(x, 0.01 + BEAM.radius), np.zeros_like(x)])
    for _ in range(12):
        order = random.permutation(8)
        faces = np.argsort(order)[mesh.faces]
        part = Solid(trimesh.Trimesh(mesh.vertices[order], faces, process=False)).touched_by(line)
        assert isinstance(part, Line)
        below_beam = part.point - part.point[2] / part.direction[2] * part.direction
        assert below_beam == pytest.approx([-0.01, 0.01, 0.0], abs=1e-12)
