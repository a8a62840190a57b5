"""Crossings of a network of lines: detected as dark blobs, numbered outward from one of them."""

from collections import deque
from typing import Final

import cv2
import numpy as np
from scipy.spatial import KDTree

from solver.calibrate.thresholds import THRESHOLDS
from solver.instrument.arrays import Floats

_START_COUNT: Final = 5

Node = tuple[int, int]
Lattice = dict[Node, Floats]


def crossings(darkness: Floats, scale: float, expected: int) -> Floats:
    """Detect candidates (n, 2) [px] for crossings of dark lines of width `scale` [px].

    Where lines cross, the darkness blurred to `scale` has negative curvature in every direction;
    along a line it does not. The product of both curvatures (determinant of Hessian) peaks there.
    """
    blurred = cv2.GaussianBlur(darkness, (0, 0), max(scale, 1.2))
    dv, du = np.gradient(blurred)
    dvv, dvu = np.gradient(dv)
    duu = np.gradient(du, axis=1)
    response = np.where(duu + dvv < 0, duu * dvv - dvu**2, 0)
    size = 2 * max(round(scale), 1) + 1
    # Crossings on the image's border are only partly visible.
    for border in (response[:size], response[-size:], response[:, :size], response[:, -size:]):
        border[:] = 0
    local_max = cv2.dilate(response, np.ones((size, size), np.uint8))
    strengths = response[(response == local_max) & (response > 0)]
    if len(strengths) < 4:
        return np.empty((0, 2))
    typical = np.median(np.sort(strengths)[-expected:])
    v, u = np.nonzero((response == local_max) & (response > THRESHOLDS.min_response * typical))
    return np.column_stack([u, v]).astype(np.float64)


def lattice(candidates: Floats) -> Lattice:
    """Find the largest set of candidates (n, 2) [px] that continues one cell: pixel by node.

    A cell is square. A node is (column, row), counted from the start of the search, columns to the
    right and rows downward in the image; the network is turned by less than 45 degrees.
    """
    if len(candidates) < 4:
        return {}
    tree = KDTree(candidates)
    middle = np.median(candidates, axis=0)
    starts = tree.query(middle, min(_START_COUNT, len(candidates)))[1]
    return max((_grow(candidates, tree, int(start)) for start in starts), key=len)


def _grow(candidates: Floats, tree: KDTree, start: int) -> Lattice:
    offsets = candidates - candidates[start]
    distance = np.linalg.norm(offsets, axis=1)
    horizontal = np.abs(offsets[:, 0]) > np.abs(offsets[:, 1])
    steps: dict[Node, dict[Node, Floats]] = {(0, 0): {}}
    for direction, in_direction in (
        ((1, 0), horizontal & (offsets[:, 0] > 0)),
        ((0, 1), ~horizontal & (offsets[:, 1] > 0)),
    ):
        if not in_direction.any():
            return {}
        steps[0, 0][direction] = offsets[np.argmin(np.where(in_direction, distance, np.inf))]
    nodes, used, queue = {(0, 0): candidates[start]}, {start}, deque([(0, 0)])
    while queue:
        node = queue.popleft()
        for axis in ((1, 0), (0, 1)):
            for sign in (1, -1):
                step = sign * steps[node][axis]
                neighbour = (node[0] + sign * axis[0], node[1] + sign * axis[1])
                deviation, nearest = tree.query(nodes[node] + step)
                is_close = deviation < THRESHOLDS.max_lattice_deviation * float(
                    np.linalg.norm(step)
                )
                if neighbour in nodes or nearest in used or not is_close:
                    continue
                nodes[neighbour] = candidates[nearest]
                used.add(nearest)
                # Perspective and the lens change the step from cell to cell.
                steps[neighbour] = steps[node] | {axis: sign * (candidates[nearest] - nodes[node])}
                queue.append(neighbour)
    return nodes
