"""Detection of the paper's target: a network of dark lines, identified by its two thick lines."""

from collections import defaultdict
from typing import Final

import cv2
import numpy as np
from scipy.ndimage import spline_filter

from solver.calibrate.board_detection import BoardDetection
from solver.calibrate.lattice import Lattice, Node, crossings, lattice
from solver.calibrate.strokes import Stroke, crossing, stroke
from solver.instrument.arrays import Floats, Grey
from solver.instrument.board import LineNetwork

# Blur [px] with which a cubic spline through the image's pixels is accurate between them.
BLUR_PX: Final = 1.0
# Trial shares of the image's width that the network fills; they give the trial line distances.
_FILLS: Final = (1.0, 0.7, 0.5, 0.35)
_FEWEST: Final = 3
# Threshold of a thick line's width over its neighbours'; it is printed twice as wide.
_THICK: Final = 1.5
# Largest distance of a crossing of the curves from its detection, over the lines' distance.
_ASTRAY: Final = 0.15


def line_network(view: Grey, board: LineNetwork) -> BoardDetection | None:
    """Detect the crossings in a view (height, width); return None if they are not identified."""
    tried = [_lattice(view, board, fill * view.shape[1] / board.columns) for fill in _FILLS]
    best = max(tried, key=len)
    if len(best) < _FEWEST**2:
        return None
    # Repeat with the estimated line distance.
    spacing = _spacing(best)
    best = _lattice(view, board, spacing)
    darkness = cv2.GaussianBlur(_darkness(view, spacing), (0, 0), BLUR_PX)
    spline = spline_filter(darkness, order=3)
    widest = 2.6 * spacing * board.line_width / board.square
    rows, columns = (_strokes(spline, best, axis, widest) for axis in (1, 0))
    thick_column, thick_row = _thick(columns), _thick(rows)
    if thick_column is None or thick_row is None:
        return None
    height, width = view.shape
    seen: dict[int, Floats] = {}
    for (across, down), near in best.items():
        column = across - thick_column + board.thick_column
        row = down - thick_row + board.thick_row
        printed = 0 <= column < board.columns and 0 <= row < board.rows
        if not (printed and across in columns and down in rows):
            continue
        pixel = crossing(rows[down].curve, columns[across].curve, near)
        rim = min(*pixel, *(np.array([width, height]) - 1 - pixel))
        # Reject a crossing on the image's rim, or far from its detection.
        if rim > widest and np.linalg.norm(pixel - near) < _ASTRAY * spacing:
            seen[row * board.columns + column] = pixel
    if not seen:
        return None
    numbers = sorted(seen)
    return BoardDetection(np.array(numbers), np.array([seen[number] for number in numbers]))


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
    lit = cv2.erode((card > 0.2 * card.max()).astype(np.uint8), kernel) > 0
    return np.where(lit, 1 - view / np.maximum(card, 1e-9), 0.0).astype(np.float64)


def _lattice(view: Grey, board: LineNetwork, spacing: float) -> Lattice:
    """Detect crossings of lines about `spacing` [px] apart, to about a pixel."""
    thin = spacing * board.line_width / board.square
    return lattice(crossings(_darkness(view, spacing), thin, board.columns * board.rows))


def _spacing(found: Lattice) -> float:
    """Compute the median distance [px] from a node to the next in its row or column."""
    neighbours = [
        (node, (node[0] + right, node[1] + 1 - right)) for node in found for right in (0, 1)
    ]
    steps = [found[other] - found[node] for node, other in neighbours if other in found]
    return float(np.median(np.linalg.norm(steps, axis=1)))


def _strokes(spline: Floats, found: Lattice, axis: int, widest: float) -> dict[int, Stroke]:
    """Trace the rows (axis 1) or columns (axis 0) of a lattice; return them by their number."""
    lines: dict[int, list[Node]] = defaultdict(list)
    for node in sorted(found):
        lines[node[axis]].append(node)
    strokes = {}
    for number, nodes in lines.items():
        if len(nodes) < _FEWEST:
            continue
        pixels = np.array([found[node] for node in nodes])
        followed = stroke(spline, [node[1 - axis] for node in nodes], pixels, widest)
        if followed is not None:
            strokes[number] = followed
    return strokes


def _thick(strokes: dict[int, Stroke]) -> int | None:
    """Return the number of the only line clearly wider than its neighbours; None without one."""
    ratio = {}
    for number, line in strokes.items():
        beside = [strokes[n].width for n in (number - 1, number + 1) if n in strokes]
        if beside:
            ratio[number] = line.width / (sum(beside) / len(beside))
    thick = [number for number, value in ratio.items() if value > _THICK]
    return thick[0] if len(thick) == 1 else None
