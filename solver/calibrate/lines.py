"""Detection of the paper's target: a network of dark lines, identified by its two thick lines."""

from collections import defaultdict
from typing import Final

import cv2
import numpy as np
from scipy.ndimage import spline_filter

from solver.calibrate.board_detection import BoardDetection
from solver.calibrate.lattice import Lattice, Node, crossings, lattice
from solver.calibrate.strokes import Stroke, crossing, stroke
from solver.calibrate.thresholds import THRESHOLDS
from solver.instrument.arrays import Floats, Grey
from solver.instrument.board import LineNetwork

# Blur [px] with which a cubic spline through the image's pixels is accurate between them.
BLUR_PX: Final = 1.0
# Trial fractions of the image's width that the network fills; they give the trial line distances.
_FILL_FRACTIONS: Final = (1.0, 0.7, 0.5, 0.35)
_MIN_LINES: Final = 3


def line_network(view: Grey, board: LineNetwork) -> BoardDetection | None:
    """Detect the crossings in a view (height, width); return None if they are not identified."""
    lattices = [
        _lattice(view, board, fill * view.shape[1] / board.columns) for fill in _FILL_FRACTIONS
    ]
    best = max(lattices, key=len)
    if len(best) < _MIN_LINES**2:
        return None
    # Repeat with the estimated line distance.
    spacing = _spacing(best)
    best = _lattice(view, board, spacing)
    darkness = cv2.GaussianBlur(_darkness(view, spacing), (0, 0), BLUR_PX)
    spline = spline_filter(darkness, order=3)
    max_width = 2.6 * spacing * board.line_width / board.square
    rows, columns = (_strokes(spline, best, axis, max_width) for axis in (1, 0))
    thick_column, thick_row = _thick(columns), _thick(rows)
    if thick_column is None or thick_row is None:
        return None
    height, width = view.shape
    detected: dict[int, Floats] = {}
    for (i, j), approximate in best.items():
        column = i - thick_column + board.thick_column
        row = j - thick_row + board.thick_row
        on_board = 0 <= column < board.columns and 0 <= row < board.rows
        if not (on_board and i in columns and j in rows):
            continue
        pixel = crossing(rows[j].curve, columns[i].curve, approximate)
        margin = min(*pixel, *(np.array([width, height]) - 1 - pixel))
        # Reject a crossing near the image's border, or far from its detection.
        if (
            margin > max_width
            and np.linalg.norm(pixel - approximate) < THRESHOLDS.max_crossing_deviation * spacing
        ):
            detected[row * board.columns + column] = pixel
    if not detected:
        return None
    numbers = sorted(detected)
    return BoardDetection(np.array(numbers), np.array([detected[number] for number in numbers]))


def _darkness(view: Grey, spacing: float) -> Floats:
    """Compute 1 minus image over card (height, width): 0 on the card, about 1 in ink.

    The card's brightness is the morphological closing of the image, which removes everything dark
    that is thinner than half the lines' distance.
    """
    size = max(round(spacing / 2), 3)
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size))
    smooth = cv2.GaussianBlur(view.astype(np.float32), (0, 0), BLUR_PX)
    card = cv2.GaussianBlur(cv2.morphologyEx(smooth, cv2.MORPH_CLOSE, kernel), (0, 0), size / 2)
    # No ink is assumed beside the card, and where its edge would look like a line.
    on_card = cv2.erode((card > 0.2 * card.max()).astype(np.uint8), kernel) > 0
    return np.where(on_card, 1 - view / np.maximum(card, 1e-9), 0.0).astype(np.float64)


def _lattice(view: Grey, board: LineNetwork, spacing: float) -> Lattice:
    """Detect crossings of lines about `spacing` [px] apart, to about a pixel."""
    line_width = spacing * board.line_width / board.square
    return lattice(crossings(_darkness(view, spacing), line_width, board.columns * board.rows))


def _spacing(nodes: Lattice) -> float:
    """Compute the median distance [px] from a node to the next in its row or column."""
    pairs = [(node, (node[0] + right, node[1] + 1 - right)) for node in nodes for right in (0, 1)]
    steps = [nodes[neighbour] - nodes[node] for node, neighbour in pairs if neighbour in nodes]
    return float(np.median(np.linalg.norm(steps, axis=1)))


def _strokes(spline: Floats, grid: Lattice, axis: int, max_width: float) -> dict[int, Stroke]:
    """Trace the rows (axis 1) or columns (axis 0) of a lattice; return them by their number."""
    lines: dict[int, list[Node]] = defaultdict(list)
    for node in sorted(grid):
        lines[node[axis]].append(node)
    strokes = {}
    for number, nodes in lines.items():
        if len(nodes) < _MIN_LINES:
            continue
        pixels = np.array([grid[node] for node in nodes])
        traced = stroke(spline, [node[1 - axis] for node in nodes], pixels, max_width)
        if traced is not None:
            strokes[number] = traced
    return strokes


def _thick(strokes: dict[int, Stroke]) -> int | None:
    """Return the number of the only line clearly wider than its neighbours; None without one."""
    ratio = {}
    for number, line in strokes.items():
        neighbours = [strokes[n].width for n in (number - 1, number + 1) if n in strokes]
        if neighbours:
            ratio[number] = line.width / (sum(neighbours) / len(neighbours))
    thick = [
        number for number, width_ratio in ratio.items() if width_ratio > THRESHOLDS.min_thick_ratio
    ]
    return thick[0] if len(thick) == 1 else None
