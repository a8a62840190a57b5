"""Stretches of cables between two marks, and their middle lines, from labelled images.

The middle line of a label is the mean of its two borders along normals of its thinned shape, and
averaged over 7 px along the line. Labels have whole pixels, and people drew them: the line is good
to about half a pixel, not better. Where cables cross the label has no border, and no reference.
"""

from collections.abc import Iterator
from typing import Any, Final, NamedTuple

import cv2
import numpy as np
import numpy.typing as npt
from scipy.ndimage import gaussian_filter1d, label, map_coordinates
from scipy.spatial import cKDTree

from solver.instrument.arrays import Floats, Mask

# Shortest stretch [px]. Chosen: eight widths of the cables, which are 9 to 13 px wide.
SHORTEST: Final = 100
# A stretch turns and leaves the line between its ends by less than these. Derived: the tracer's
# slopes end at 0.75, and its strip at 0.2 of the length.
STEEPEST, FARTHEST = 0.6, 0.17
# Parts whose ends face each other over this many widths, within this angle, are one cable.
_GAP_WIDTHS, _GAP_TURN = 8.0, np.radians(35)
_LONGEST: Final = 900


class Stretch(NamedTuple):
    """Middle line (n, 2) [px] with unit normals; `visible` (n,) where the label has two borders."""

    line: Floats
    normals: Floats
    visible: Mask


class _Part(NamedTuple):
    line: Floats
    visible: Mask


def stretches(labels: npt.NDArray[np.uint8], cable: int) -> Iterator[Stretch]:
    """Cut one cable of an image of labels (height, width) into stretches that can be traced."""
    mask = labels == cable
    parts, width = _parts(mask)
    for chain in _chains(parts, width):
        reference = _between_borders(chain, width, mask)
        if reference is not None:
            yield from _cut(reference, int(width))


def _parts(mask: Mask) -> tuple[list[Floats], float]:
    """Thin a label to ordered pixels (n, 2) of its parts between crossings; return its width."""
    smooth = np.asarray(cv2.GaussianBlur(mask.astype(np.float32), (0, 0), 2.0)) > 0.5
    thin = np.asarray(cv2.ximgproc.thinning(255 * smooth.astype(np.uint8))) > 0
    to_border = np.asarray(cv2.distanceTransform(smooth.astype(np.uint8), cv2.DIST_L2, 5))
    width = 2 * float(np.median(to_border[thin])) if thin.any() else 1.0
    crossing = (thin & (2 * to_border > 1.2 * width)).astype(np.uint8)
    size = 2 * int(np.ceil(width)) + 1
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size))
    numbers, count = label(thin & (np.asarray(cv2.dilate(crossing, disc)) == 0), np.ones((3, 3)))
    parts = [
        line
        for number in range(1, count + 1)
        if (line := _ordered(np.argwhere(numbers == number)[:, ::-1].astype(float))) is not None
        and len(line) >= 3 * width
    ]
    return parts, width


def _ordered(pixels: Floats) -> Floats | None:
    """Order the pixels (n, 2) of a thin line from one end to the other; None for a ring."""
    near = cKDTree(pixels).query_ball_point(pixels, 1.5)
    ends = [i for i, others in enumerate(near) if len(others) == 2]
    if not ends:
        return None
    order, rest = [ends[0]], set(range(len(pixels))) - {ends[0]}
    while nexts := [i for i in near[order[-1]] if i in rest]:
        last = pixels[order[-1]]
        order.append(min(nexts, key=lambda i: float(np.sum((pixels[i] - last) ** 2))))
        rest.remove(order[-1])
    return pixels[order]


def _chains(parts: list[Floats], width: float) -> Iterator[_Part]:
    """Join parts whose ends face each other; a gap between two is straight and not visible."""
    far = int(2 * width) + 4
    # End 2 i is the first pixel of part i, end 2 i + 1 its last.
    ends = [end for part in parts for end in (part[0], part[-1])]
    inner = [
        end
        for part in parts
        for end in (part[min(far, len(part) - 1)], part[max(-far, -len(part))])
    ]
    ways = [_unit(end - before) for end, before in zip(ends, inner, strict=True)]
    pairs = []
    for a in range(len(ends)):
        for b in range(a):
            gap = ends[b] - ends[a]
            distance = float(np.linalg.norm(gap))
            if a // 2 == b // 2 or not 0 < distance < _GAP_WIDTHS * (width + 1):
                continue
            along = min(ways[a] @ gap / distance, -ways[b] @ gap / distance, -ways[a] @ ways[b])
            if along > np.cos(_GAP_TURN):
                pairs.append((distance / (40 * width) - along, a, b))
    other: dict[int, int] = {}
    for _, a, b in sorted(pairs):
        if a not in other and b not in other:
            other[a], other[b] = b, a
    done: set[int] = set()
    for first in range(len(ends)):
        end, lines, visible = first, list[Floats](), list[Mask]()
        while first not in other and end // 2 not in done:
            done.add(end // 2)
            line = parts[end // 2][:: 1 if end % 2 == 0 else -1]
            if lines:
                start, steps = lines[-1][-1], int(np.linalg.norm(line[0] - lines[-1][-1]))
                share = np.linspace(0, 1, steps + 1)[1:-1, None]
                lines.append(start + share * (line[0] - start))
                visible.append(np.zeros(len(share), np.bool_))
            lines.append(line)
            visible.append(np.ones(len(line), np.bool_))
            end = other.get(end ^ 1, end)
        if lines:
            yield _Part(np.vstack(lines), np.concatenate(visible))


def _unit(vector: Floats) -> Floats:
    return vector / max(float(np.linalg.norm(vector)), 1e-9)


def _between_borders(chain: _Part, width: float, mask: Mask) -> Stretch | None:
    """Move a chain of pixels to the middle of the label's borders, a point per pixel."""
    length = np.append(0, np.cumsum(np.linalg.norm(np.diff(chain.line, axis=0), axis=1)))
    at = np.arange(0, length[-1], 1.0)
    line = _smooth(np.column_stack([np.interp(at, length, xy) for xy in chain.line.T]), 4)
    visible = np.interp(at, length, chain.visible) > 0.99
    soft = np.asarray(cv2.GaussianBlur(mask.astype(np.float32), (0, 0), 0.7))
    across = np.arange(-1.2 * width, 1.2 * width, 0.1)
    middle = len(across) // 2
    good = np.zeros(len(line), np.bool_)
    for _ in range(2):
        normals = _normals(line)
        v, u = np.moveaxis(line[:, None] + across[:, None] * normals[:, None], -1, 0)[::-1]
        outside = map_coordinates(soft, [v, u], order=1) < 0.5
        right = np.argmax(outside[:, middle:], axis=1)
        left = np.argmax(outside[:, middle::-1], axis=1)
        good = (right > 0) & (left > 0)
        if np.count_nonzero(good) < SHORTEST:
            return None
        typical = np.median((left + right)[good])
        good &= np.abs(left + right - typical) < 0.3 * typical
        places = np.arange(len(line))
        off = np.interp(places, places[good], 0.05 * (right - left)[good])
        line = line + _smooth(off, 3)[:, None] * normals
    return Stretch(line, _normals(line), visible & good)


def _smooth(values: Any, sigma: float) -> Floats:
    return np.asarray(gaussian_filter1d(values, sigma, axis=0, mode="nearest"))


def _normals(line: Floats) -> Floats:
    tangents = np.gradient(line, axis=0)
    tangents = tangents / np.linalg.norm(tangents, axis=1)[:, None]
    return np.column_stack([-tangents[:, 1], tangents[:, 0]])


def _cut(whole: Stretch, width: int) -> Iterator[Stretch]:
    """Cut a line into the longest stretches from its begin on that a tracer may be asked for."""
    first, last = width, len(whole.line) - width
    while first < last - SHORTEST:
        ends = range(min(last - 1, first + _LONGEST), first + SHORTEST, -10)
        end = next((end for end in ends if _is_traceable(whole, first, end)), None)
        if end is not None:
            piece = slice(first, end + 1)
            yield Stretch(whole.line[piece], whole.normals[piece], whole.visible[piece])
        first = first + 10 if end is None else end + 1


def _is_traceable(whole: Stretch, first: int, end: int) -> bool:
    line, visible = whole.line[first : end + 1], whole.visible[first : end + 1]
    chord = line[-1] - line[0]
    length = float(np.linalg.norm(chord))
    if length < SHORTEST or not (visible[0] and visible[-1]) or visible.mean() <= 0.6:
        return False
    along, across = chord / length, np.array([-chord[1], chord[0]]) / length
    steps = np.diff(line[::5], axis=0)
    forward = steps @ along
    steep = np.abs(steps @ across) / np.maximum(forward, 1e-9)
    off = np.abs((line - line[0]) @ across)
    return bool(forward.min() > 0 and steep.max() < STEEPEST and off.max() < FARTHEST * length)
