"""Crossings of a network of lines: detected as dark blobs, numbered outward from one of them."""

from collections import deque
from typing import Final

import cv2
import numpy as np
from scipy.spatial import KDTree

from solver.instrument.arrays import Floats

# Largest distance of a crossing from its expected place, over the distance to its neighbour.
_ASTRAY: Final = 0.25
_STARTS: Final = 5
# Threshold over the typical crossing's response; line ends and dirt respond less.
_LEAST_RESPONSE: Final = 0.3

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
    reach = 2 * max(round(scale), 1) + 1
    # Crossings on the image's rim are only partly visible.
    for rim in (response[:reach], response[-reach:], response[:, :reach], response[:, -reach:]):
        rim[:] = 0
    highest = cv2.dilate(response, np.ones((reach, reach), np.uint8))
    strengths = response[(response == highest) & (response > 0)]
    if len(strengths) < 4:
        return np.empty((0, 2))
    typical = np.median(np.sort(strengths)[-expected:])
    v, u = np.nonzero((response == highest) & (response > _LEAST_RESPONSE * typical))
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
    starts = tree.query(middle, min(_STARTS, len(candidates)))[1]
    return max((_grown(candidates, tree, int(start)) for start in starts), key=len)


def _grown(candidates: Floats, tree: KDTree, start: int) -> Lattice:
    apart = candidates - candidates[start]
    distance = np.linalg.norm(apart, axis=1)
    lying = np.abs(apart[:, 0]) > np.abs(apart[:, 1])
    steps: dict[Node, dict[Node, Floats]] = {(0, 0): {}}
    for direction, chosen in (
        ((1, 0), lying & (apart[:, 0] > 0)),
        ((0, 1), ~lying & (apart[:, 1] > 0)),
    ):
        if not chosen.any():
            return {}
        steps[0, 0][direction] = apart[np.argmin(np.where(chosen, distance, np.inf))]
    found, taken, waiting = {(0, 0): candidates[start]}, {start}, deque([(0, 0)])
    while waiting:
        node = waiting.popleft()
        for axis in ((1, 0), (0, 1)):
            for sign in (1, -1):
                step = sign * steps[node][axis]
                neighbour = (node[0] + sign * axis[0], node[1] + sign * axis[1])
                off, nearest = tree.query(found[node] + step)
                near = off < _ASTRAY * float(np.linalg.norm(step))
                if neighbour in found or nearest in taken or not near:
                    continue
                found[neighbour] = candidates[nearest]
                taken.add(nearest)
                # Perspective and the lens change the step from cell to cell.
                steps[neighbour] = steps[node] | {axis: sign * (candidates[nearest] - found[node])}
                waiting.append(neighbour)
    return found
