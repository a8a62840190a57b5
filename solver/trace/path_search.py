"""Search for the path of a beam between its clamp and its tip in a photograph.

A beam is a pair of edges of opposite sign. In a strip along the line from the clamp to the tip, the
measure of a pixel, for one width and sign, is the smaller contrast of the two edges about it: a
single edge, such as a table's, has none. Short straight segments are chained from the clamp to the
tip by dynamic programming over their place and slope (as in Geman and Jedynak 1996), once for every
width and sign; each width is searched at a resolution that suits it.
"""

from typing import Any, Final, NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

from solver.instrument.arrays import Floats, copy_into
from solver.instrument.compiled import FAST, njit
from solver.instrument.medians import SIGMA_OVER_MAD

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
# Cost of a change of slope by one step, over the largest score of a segment. Chosen: at 0 the path
# follows texture, at 0.2 it cuts bends of a beam of little contrast.
TURN: Final = 0.04
# Largest distance [px] of the path's ends from the marks. Chosen: more than two sigmas of a
# careless mark.
NEAR_MARK: Final = 8.0
# Of paths whose support differs by less than SUPPORT, those of at least CONTRAST times the largest
# contrast compete, and the widest is the beam: grain and highlights are within it. Chosen.
SUPPORT: Final = 0.1
CONTRAST: Final = 0.6
# Widths whose ratio is less follow the same edges, and paths that are tried. Chosen.
MAX_WIDTH_RATIO, TRIALS = 2.1, 3
# Standard deviation of rounding to whole gray values. Derived.
ROUNDING: Final = 0.29
# Support of a measure that exceeds this many sigmas of the measure elsewhere is full. Chosen.
FULL_SUPPORT: Final = 3.0


class BeamPath(NamedTuple):
    """Path of a beam.

    `points` (n, 2) [px] are its nodes from the clamp to the tip, `width` [px] and `sign` (1 where
    the beam is brighter than its background, else -1) those of its edges. `support` (0 to 1) is the
    fraction of the path on which both edges stand out, `contrast` [gray] their median height.
    """

    points: Floats
    width: float
    sign: int
    support: float
    contrast: float


def beam_paths(image: Image, clamp: Floats, tip: Floats) -> list[BeamPath]:
    """Find paths of a beam from `clamp` to `tip` (2,) [px] in an image (height, width).

    The most likely path is the first, up to TRIALS. The nodes are within about a pixel, or a
    quarter of the width, of the centreline.
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
    strip: Any = cv2.warpAffine(image, strip_from_image, size, borderMode=cv2.BORDER_REPLICATE)
    # What is outside the image has no edges.
    inside: Any = cv2.warpAffine(np.ones_like(image), strip_from_image, size)
    candidates = []
    for level, widths in enumerate(WIDTHS):
        pixel = 2**level
        for width in widths:
            if width * pixel * SLENDER > length:
                continue
            # The centre of pixel i of a strip reduced by p is at (i + 1/2) p - 1/2.
            first = int(np.ceil((half - NEAR_MARK + 0.5) / pixel - 0.5))
            last = int(np.floor((half + NEAR_MARK + 0.5) / pixel - 0.5))
            for path in _paths(strip, inside, width, first, last):
                place = (path.points + 0.5) * pixel - 0.5
                points = corner + place[:, :1] * along + place[:, 1:] * across
                candidates.append(path._replace(points=points, width=path.width * pixel))
        half_size = (strip.shape[1] // 2, strip.shape[0] // 2)
        strip = cv2.resize(strip, half_size, interpolation=cv2.INTER_AREA)
        inside = cv2.resize(inside, half_size, interpolation=cv2.INTER_AREA)
    paths: list[BeamPath] = []
    while candidates and len(paths) < TRIALS:
        paths.append(_likeliest(candidates))
        # Similar widths follow the same edges.
        candidates = [path for path in candidates if not _alike(path, paths[-1])]
    return paths


def _likeliest(candidates: list[BeamPath]) -> BeamPath:
    """Choose the widest of the paths that are well supported."""
    best = max(path.support for path in candidates)
    supported = [path for path in candidates if path.support > best - SUPPORT]
    strongest = max(path.contrast for path in supported)
    # The strongest itself as well where an image without a beam leaves a contrast of 0 or less.
    least = min(CONTRAST * strongest, strongest)
    strong = [path for path in supported if path.contrast >= least]
    widest = max(strong, key=lambda path: path.width)
    # A width that is a little too large has some contrast as well.
    return max((path for path in strong if _alike(path, widest)), key=lambda path: path.contrast)


def _alike(path: BeamPath, other: BeamPath) -> bool:
    ratio = path.width / other.width
    return path.sign == other.sign and 1 / MAX_WIDTH_RATIO < ratio < MAX_WIDTH_RATIO


def _paths(strip: Image, inside: Image, width: float, first: int, last: int) -> list[BeamPath]:
    """Find the best path of either sign in a strip (height, length), in the strip's pixels."""
    kernel = _edge_kernel(width)
    left = cv2.filter2D(strip, cv2.CV_32F, kernel, borderType=cv2.BORDER_REPLICATE)
    right = cv2.filter2D(strip, cv2.CV_32F, kernel[::-1], borderType=cv2.BORDER_REPLICATE)
    paths = []
    for sign in (1, -1):
        measure = np.minimum(sign * left, sign * right) * (inside > 0.999)
        # With the place across the strip last, all places are computed at once.
        measure = np.ascontiguousarray(measure.T)
        columns = np.maximum(measure, 0).max(axis=1)
        most = max(float(np.median(columns)), 1e-3)
        nodes = _chain(np.clip(measure, 0, most), np.float32(TURN * SEGMENT * most), first, last)
        along = np.arange(len(measure))
        place = np.interp(along, np.arange(len(nodes)) * SEGMENT, nodes)
        on_path = measure[along, np.rint(place).astype(int)]
        scatter = SIGMA_OVER_MAD * float(np.median(np.abs(measure[::3, ::3]))) + ROUNDING
        support = float(np.clip(on_path / (FULL_SUPPORT * scatter), 0, 1).mean())
        points = np.column_stack([np.arange(len(nodes)) * SEGMENT, nodes]).astype(float)
        paths.append(BeamPath(points, width, sign, support, float(np.median(on_path))))
    return paths


def _edge_kernel(width: float) -> Image:
    """Compute the column (n, 1) of weights of a bright beam's edge at -width / 2."""
    box = max(1.0, EDGE * width)
    reach = int(np.ceil(width / 2 + box))
    edges = np.arange(-reach, reach + 2) - 0.5

    def mean(low: float) -> Floats:
        return np.asarray(np.diff(np.clip(edges, low, low + box)) / box)

    kernel = mean(-width / 2) - mean(-width / 2 - box)
    return np.asarray(kernel, np.float32)[:, None]


@njit(fastmath=FAST)
def _chain(measure: Any, turn: Any, first: int, last: int) -> Any:
    """Chain segments through `measure` (length, places); return the nodes' places (n,).

    The chain begins and ends at the places from `first` to `last`.
    """
    length, places = measure.shape
    count, slopes = (length - 1) // SEGMENT, 2 * MAX_RISE + 1
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
            low, high = max(0, -slope), min(places, places - slope)
            for q in range(SEGMENT):
                shift = int(np.floor(slope * (q + 0.5) / SEGMENT + 0.5))
                row = measure[segment * SEGMENT + q]
                for n in range(low, high):
                    total[m, n] += row[n + shift]
            for n in range(low, high):
                best[m, n + slope] = total[m, n]
        score = best
    end, state, place = np.float32(-1e30), 0, first
    for m in range(slopes):
        for n in range(first, last + 1):
            if score[m, n] > end:
                end, state, place = score[m, n], m, n
    return _traced_back(before, state, place)


@njit
def _traced_back(before: Any, state: int, place: int) -> Any:
    """Follow the chain that ends at a slope and a place back; return its places (n,)."""
    count = len(before)
    nodes = np.empty(count + 1)
    nodes[count] = place
    for segment in range(count - 1, -1, -1):
        place -= state - MAX_RISE
        nodes[segment] = place
        state = before[segment, state, place]
    return nodes
