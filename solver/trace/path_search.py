"""Search for the path of a beam between its clamp and its tip in a photograph.

A beam is a pair of edges at a constant distance, each with a contrast of its own: it may be
brighter than what is on one side and darker than what is on the other. In a strip along the line
from the clamp to the tip, the measure of a short straight segment, for one width, is the smaller
contrast of its two edges: a single edge, such as a table's, has none. A contrast is the length of
the mean difference of the channels across an edge, so that what differs along it, such as texture,
cancels. Segments are chained from the clamp to the tip by dynamic programming over their place and
slope (as in Geman and Jedynak 1996), once for every width; each width is searched at a resolution
that suits it.
"""

from typing import Any, Final, NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

from solver.instrument.arrays import Floats, copy_into
from solver.instrument.compiled import FAST, njit

Image = npt.NDArray[np.float32]

# Widths [px] that are searched at full resolution, and at each halving of it, in its own pixels. A
# beam between two of them is 20 % off, which an edge's box (EDGE) admits. Coarser pixels would not
# separate the marks from the gap between the beam and an edge beside it.
WIDTHS: Final = ((1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0), (6.0, 8.0), (6.0, 8.0, 12.0, 16.0))
# Thickness of the boxes whose means are an edge's contrast, over the width; at least one pixel.
EDGE: Final = 0.3
# A beam is at least this many times longer than wide. Chosen: a stick.
SLENDER: Final = 8
# Half the strip's height over the length, and a margin [px]. Derived: a cantilever whose tip is
# turned by 40 degrees leaves the line from clamp to tip by 0.1 of its length.
HALF_STRIP: Final = 0.2
# Pixels of a segment along the strip; slopes from -MAX_RISE / SEGMENT to MAX_RISE / SEGMENT.
SEGMENT: Final = 8
MAX_RISE: Final = 6
MOST_TURN: Final = 2
# Cost of a change of slope by one step, over the largest measure of a segment. Chosen: at 0 the
# path follows texture, at 0.2 it cuts bends of a beam of little contrast.
TURN: Final = 0.04
# Largest distance [px] of the path's ends from the marks. Chosen: more than two sigmas of a
# careless mark.
NEAR_MARK: Final = 8.0
# Least contrast of a path over that of the strongest. Chosen: a whisker has a third of the contrast
# of the shading beside it, and grain a tenth of that of its beam.
CONTRAST: Final = 0.25
# Widths whose ratio is less follow the same edges. Chosen.
MAX_WIDTH_RATIO: Final = 2.1
# Standard deviation of rounding to whole gray values. Derived.
ROUNDING: Final = 0.29
# A segment stands out if its measure is this many times the quantile TEXTURE of those elsewhere.
# Measured: the best paths on texture have a median of 1.1 times this quantile.
STANDS_OUT, TEXTURE = 2.0, 0.95


class BeamPath(NamedTuple):
    """Path of a beam.

    `points` (n, 2) [px] are its nodes from the clamp to the tip, `width` [px] is that of its edges.
    `support` (0 to 1) is the fraction of the path on which both edges stand out, `contrast` [gray]
    the median of the weaker edge's.
    """

    points: Floats
    width: float
    support: float
    contrast: float


def beam_paths(image: Image, clamp: Floats, tip: Floats) -> list[BeamPath]:
    """Find paths of a beam from `clamp` to `tip` (2,) [px] in channels (height, width, c).

    The channels have equal noise. Paths differ in width by a factor of two or more, the strongest
    is the first. The nodes are within about a pixel, or a quarter of the width, of the centreline.
    """
    chord = tip - clamp
    length = float(np.linalg.norm(chord))
    along = chord / length
    across = np.array([-along[1], along[0]])
    half = int(HALF_STRIP * length + 2 * NEAR_MARK)
    corner = clamp - half * across
    strip_from_image = np.linalg.inv(
        np.vstack([np.column_stack([along, across, corner]), [0.0, 0.0, 1.0]])
    )[:2]
    size = (int(length) + 1, 2 * half + 1)
    strip = _warped(image, strip_from_image, size)
    # What is outside the image has no edges.
    inside = _warped(np.ones_like(image[..., :1]), strip_from_image, size, cv2.BORDER_CONSTANT)
    candidates = []
    for level, widths in enumerate(WIDTHS):
        pixel = 2**level
        for width in widths:
            if width * pixel * SLENDER > length:
                continue
            # The centre of pixel i of a strip reduced by p is at (i + 1/2) p - 1/2.
            first = int(np.ceil((half - NEAR_MARK + 0.5) / pixel - 0.5))
            last = int(np.floor((half + NEAR_MARK + 0.5) / pixel - 0.5))
            path = _path(strip, inside, width, first, last)
            place = (path.points + 0.5) * pixel - 0.5
            points = corner + place[:, :1] * along + place[:, 1:] * across
            candidates.append(path._replace(points=points, width=path.width * pixel))
        strip, inside = _halved(strip), _halved(inside)
    paths: list[BeamPath] = []
    while candidates:
        paths.append(max(candidates, key=lambda path: path.contrast))
        # Similar widths follow the same edges.
        candidates = [path for path in candidates if not _alike(path, paths[-1])]
    return [path for path in paths if path.contrast >= CONTRAST * paths[0].contrast]


def _warped(
    image: Image, matrix: Floats, size: tuple[int, int], border: int = cv2.BORDER_REPLICATE
) -> Image:
    """Apply an affine map to channels (height, width, c); the result has them as well."""
    warped = np.asarray(cv2.warpAffine(image, matrix, size, borderMode=border), np.float32)
    return warped.reshape(*warped.shape[:2], -1)


def _halved(strip: Image) -> Image:
    """Reduce channels (height, width, c) to half their size."""
    size = (strip.shape[1] // 2, strip.shape[0] // 2)
    halved = np.asarray(cv2.resize(strip, size, interpolation=cv2.INTER_AREA), np.float32)
    return halved.reshape(*halved.shape[:2], -1)


def _alike(path: BeamPath, other: BeamPath) -> bool:
    return 1 / MAX_WIDTH_RATIO < path.width / other.width < MAX_WIDTH_RATIO


def _path(strip: Image, inside: Image, width: float, first: int, last: int) -> BeamPath:
    """Find the best path in a strip (height, length, c), in the strip's pixels."""
    # With the place across the strip last, all places are computed at once.
    edges = np.stack(
        [
            np.moveaxis(_filtered(strip, kernel) * (inside > 0.999), 0, 2)
            for kernel in _edge_kernels(width)
        ],
        axis=1,
    )
    measure = _segments(np.ascontiguousarray(edges))
    most = max(float(np.median(measure.max(axis=(1, 2)))), 1e-3)
    nodes, slopes = _chain(np.clip(measure, 0, most), np.float32(TURN * most), first, last)
    on_path = measure[np.arange(len(slopes)), slopes, nodes[:-1]]
    places = np.arange(0, measure.shape[2], max(int(width / 2), 1))
    elsewhere = np.abs(places - nodes[:-1, None]) > width
    texture = np.quantile(np.swapaxes(measure[..., places], 1, 2)[elsewhere], TEXTURE)
    level = max(float(texture), 0.0) + ROUNDING
    support = float(np.mean(on_path > STANDS_OUT * level))
    points = np.column_stack([np.arange(len(nodes)) * SEGMENT, nodes]).astype(float)
    return BeamPath(points, width, support, float(np.median(on_path)))


def _filtered(strip: Image, kernel: Image) -> Image:
    filtered = cv2.filter2D(strip, cv2.CV_32F, kernel, borderType=cv2.BORDER_REPLICATE)
    return np.asarray(filtered, np.float32).reshape(strip.shape)


def _edge_kernels(width: float) -> tuple[Image, Image, Image]:
    """Compute columns (n, 1) of weights: of the edges at -width / 2 and width / 2, and of a middle.

    Those of the edges subtract what is outside from what is inside.
    """
    box = max(1.0, EDGE * width)
    reach = int(np.ceil(width / 2 + box))
    borders = np.arange(-reach, reach + 2) - 0.5

    def step(at: float) -> Image:
        below, above = (np.diff(np.clip(borders, low, low + box)) for low in (at - box, at))
        return np.asarray((above - below) / box, np.float32)[:, None]

    return step(-width / 2), step(-width / 2)[::-1], step(0.0)


@njit(fastmath=FAST)
def _segments(edges: Any) -> Any:
    """Compute the measure of all segments (count, slopes, places) by their place at the start.

    `edges` (length, 3, c, places) are the differences across the left edge, the right edge and the
    middle. A contrast counts by what it exceeds a change in the middle that continues it: shading
    changes everywhere alike, and a wide blurred edge is a beam of a smaller width otherwise.
    """
    length, _, channels, places = edges.shape
    count, slopes = (length - 1) // SEGMENT, 2 * MAX_RISE + 1
    measure = np.zeros((count, slopes, places), np.float32)
    means = np.empty((3, channels, places), np.float32)
    for segment in range(count):
        for m in range(slopes):
            slope = m - MAX_RISE
            low, high = max(0, -slope), min(places, places - slope)
            means[:] = 0
            for q in range(SEGMENT):
                shift = int(np.floor(slope * (q + 0.5) / SEGMENT + 0.5))
                for edge in range(3):
                    for channel in range(channels):
                        row = edges[segment * SEGMENT + q, edge, channel]
                        mean = means[edge, channel]
                        for n in range(low, high):
                            mean[n] += row[n + shift] / SEGMENT
            for n in range(low, high):
                left = right = middle = np.float32(1e-12)
                both = np.float32(0)
                for channel in range(channels):
                    left += means[0, channel, n] ** 2
                    right += means[1, channel, n] ** 2
                    middle += means[2, channel, n] ** 2
                    both += means[0, channel, n] * means[1, channel, n]
                opposed = max(-both, np.float32(0)) / np.sqrt(left * right)
                measure[segment, m, n] = np.sqrt(min(left, right)) - opposed * np.sqrt(middle)
    return measure


@njit(fastmath=FAST)
def _chain(measure: Any, turn: Any, first: int, last: int) -> Any:
    """Chain segments of `measure` (n, slopes, places); return places (n + 1,) and slopes (n,).

    The chain begins and ends at the places from `first` to `last`.
    """
    count, slopes, places = measure.shape
    score = np.full((slopes, places), np.float32(-1e30))
    score[:, first : last + 1] = 0
    before = np.empty((count, slopes, places), np.int8)
    total = np.empty_like(score)
    for segment in range(count):
        best = np.full((slopes, places), np.float32(-1e30))
        for m in range(slopes):
            copy_into(total[m], score[m])
            before[segment, m] = m
            for other in range(max(m - MOST_TURN, 0), min(m + MOST_TURN + 1, slopes)):
                if other != m:
                    cost = turn * abs(other - m)
                    for n in range(places):
                        value = score[other, n] - cost
                        if value > total[m, n]:
                            total[m, n] = value
                            before[segment, m, n] = other
            slope = m - MAX_RISE
            for n in range(max(0, -slope), min(places, places - slope)):
                best[m, n + slope] = total[m, n] + measure[segment, m, n]
        score = best
    end, state, place = np.float32(-1e30), 0, first
    for m in range(slopes):
        for n in range(first, last + 1):
            if score[m, n] > end:
                end, state, place = score[m, n], m, n
    return _traced_back(before, state, place)


@njit
def _traced_back(before: Any, state: int, place: int) -> Any:
    """Follow the chain that ends at a slope and a place back; return its places and slopes."""
    count = len(before)
    nodes, slopes = np.empty(count + 1, np.int64), np.empty(count, np.int64)
    nodes[count] = place
    for segment in range(count - 1, -1, -1):
        place -= state - MAX_RISE
        nodes[segment], slopes[segment] = place, state
        state = before[segment, state, place]
    return nodes, slopes
