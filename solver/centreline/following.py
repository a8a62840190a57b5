"""Following of the beam beyond the part that was detected, step by step along it.

Detection assumes the shape of a moderately bent beam, and scan lines in one direction. A beam whose
tangent turns by a right angle leaves both: from the points that are known, the path is continued
along the beam, and each step is measured before the next one.
"""

from collections.abc import Callable

import numpy as np

from solver.centreline.guide import PLACES, Guide
from solver.centreline.thresholds import THRESHOLDS
from solver.instrument.arrays import Floats

# Distance [px] between the nodes of a path, each the mean of the points about it. Chosen: a beam
# bent to a radius of 20 px departs from its chord by 0.4 px.
NODE_PX = 8.0
# Number of nodes of a step, and of those before it from which it is extrapolated.
STEP_NODES, BEFORE_NODES = 3, 6
# Steps without points, across an object that touches the beam, after which the beam is lost.
MAX_GAP_STEPS = 3

# Measures the centres (n, 2) [px] of the beam along nodes (m, 2) [px] of a path.
Measure = Callable[[Floats], Floats]


def follow(points: Floats, guide: Guide, measure: Measure) -> Floats | None:
    """Continue the beam from its points (n, 2) [px], in their order from the clamp, to its length.

    Return the places (m, 2) [m] of its path, evenly along it; None with too few points.
    """
    if len(points) < THRESHOLDS.min_curve_points:
        return None
    clamp = guide.pixels(np.zeros((1, 2)))
    end = PLACES[-1] * guide.length
    nodes = _nodes(np.vstack([clamp, points]))
    gap = 0
    while gap < MAX_GAP_STEPS and _length(guide.places(nodes)) < end:
        step = _extrapolated(nodes)
        measured = measure(np.vstack([nodes[-1:], step]))
        ahead = _along(measured, nodes[-1], step[-1])
        if len(ahead) and len(measured) >= NODE_PX * STEP_NODES / 3:
            nodes, gap = np.vstack([nodes, ahead]), 0
        else:
            nodes, gap = np.vstack([nodes, step]), gap + 1
    places = guide.places(nodes)
    arc = _arc(places)
    even = np.linspace(0.0, min(arc[-1], end), len(PLACES))
    return np.column_stack([np.interp(even, arc, places[:, i]) for i in (0, 1)])


def _nodes(points: Floats) -> Floats:
    """Average points (n, 2) over pieces of NODE_PX along the line; the first one is kept."""
    piece = (_arc(points) / NODE_PX).astype(np.int64)
    return np.vstack([points[:1], *(points[piece == i].mean(axis=0) for i in np.unique(piece[1:]))])


def _extrapolated(nodes: Floats) -> Floats:
    """Extrapolate the next nodes (STEP_NODES, 2) along an arc of the last ones' curvature."""
    last = nodes[-BEFORE_NODES:]
    arc = _arc(last) - _arc(last)[-1]
    degree = 2 if len(last) == BEFORE_NODES else 1
    ahead = NODE_PX * np.arange(1, STEP_NODES + 1)
    return np.column_stack([np.polyval(np.polyfit(arc, last[:, i], degree), ahead) for i in (0, 1)])


def _along(measured: Floats, start: Floats, end: Floats) -> Floats:
    """Average measured points (n, 2) to nodes, in their order from `start` to `end`.

    There may be none: a foreign object beside the beam may be seen again and again.
    """
    chord = (end - start) / np.linalg.norm(end - start)
    along = (measured - start) @ chord
    piece = np.floor(along / NODE_PX).astype(np.int64)
    pieces = [measured[piece == i].mean(axis=0) for i in np.unique(piece)]
    # A node close to the last one would make the direction uncertain.
    return np.array([node for node in pieces if (node - start) @ chord > NODE_PX / 2])


def _arc(line: Floats) -> Floats:
    steps = np.hypot(*np.diff(line, axis=0).T)
    return np.concatenate([[0.0], np.cumsum(steps)])


def _length(line: Floats) -> float:
    return float(_arc(line)[-1])
