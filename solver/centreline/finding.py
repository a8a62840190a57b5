"""Which of the thin things in an image is the beam: sample consensus over bent beams.

Every scan line crosses a few thin things. A beam clamped at a known place is straight, or bends as
y = tilt x + load u(x; x_c) with the unit deflection u of eqs. (9) and (10); the shape on which most
scan lines agree is the beam (MSAC: Torr and Zisserman 2000, over contact distances and candidates
in place of random draws). Linear theory is off by a pixel where the beam bends far: the path
that is followed is the shape plus a smooth curve through the candidates beside it.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from numba import njit

from solver.beam_models.linear import unit_deflection
from solver.centreline.candidates import candidates
from solver.centreline.guide import Guide
from solver.centreline.noise import Noise
from solver.centreline.smooth import smooth_curve
from solver.instrument.arrays import Floats, Grey

# Scan lines over the beam's length, and contact distances that are tried.
LINES, DISTANCES = 72, 12
# Candidates that are tried as points of the beam.
ANCHORS = 60
# A candidate belongs to a shape up to this distance, in pixels and in the beam's radii.
NEAR_PX, NEAR_RADII = 3.0, 2.0
# The beam is seen where this many scan lines agree, of those that cross it.
LEAST_LINES = 6
# Stands for the contact distance of a beam that does not bend [m].
STRAIGHT = 1e9


@dataclass(frozen=True)
class Path:
    """Where the beam runs, to about a pixel: places (n, 2) [m] of the beam's frame, evenly along x.

    `contrast` [gray] is how far it stands out, `support` the share of scan lines that saw it.
    """

    places: Floats
    contrast: float
    support: float


def find(
    image: Grey, guide: Guide, polarity: int, noise: Noise, most_tilt: float, bends: bool
) -> Path | None:
    """The beam's path in an image (height, width), None where there is none.

    `most_tilt` [rad] is how far the beam may be turned about its clamp, beside what `bends` it.
    """
    lines = _scan_lines(guide, image.shape)
    core = max(2, round(2 * guide.radius_px))
    seen = candidates(image, lines, guide.upright, core, polarity, noise)
    if len(seen) < LEAST_LINES:
        return None
    pixels = seen[:, [0, 1]] if guide.upright else seen[:, [1, 0]]
    places = guide.places(np.ascontiguousarray(pixels))
    inside = (places[:, 0] > 0.02 * guide.length) & (places[:, 0] < 1.02 * guide.length)
    inside &= np.abs(places[:, 1]) < 0.8 * guide.length
    seen, places = seen[inside], places[inside]
    if len(seen) < LEAST_LINES:
        return None
    near = max(NEAR_PX, NEAR_RADII * guide.radius_px) * guide.pixel
    line = np.searchsorted(lines, seen[:, 0].astype(np.int64))
    distances = guide.length * np.linspace(0.08, 1.0, DISTANCES) if bends else np.array([STRAIGHT])
    # Anchors far out tell most; the strongest come first.
    order = np.argsort(-seen[:, 2] * places[:, 0])[:ANCHORS]
    # A thing much brighter than most is no better a candidate.
    weight = np.minimum(seen[:, 2], np.median(seen[:, 2]))
    load, tilt, x_c, score = _consensus(
        places[:, 0], places[:, 1], line, weight, len(lines), order, distances, near, most_tilt
    )
    if score <= 0:
        return None
    offset = places[:, 1] - _shape(places[:, 0], load, tilt, x_c)
    agreed = np.abs(offset) < near
    if len(np.unique(line[agreed])) < LEAST_LINES:
        return None
    x, contrast = places[agreed, 0], float(np.median(seen[agreed, 2]))
    along = np.linspace(0.0, 1.06 * guide.length, 96)
    half_px = np.full(len(x), 0.5 * guide.pixel)
    correction = smooth_curve(x, offset[agreed], half_px, along, degree=3)
    across = _shape(along, load, tilt, x_c)
    if correction is not None:
        across += correction
    support = len(np.unique(line[agreed])) / len(lines)
    return Path(np.column_stack([along, across]), contrast, support)


def _scan_lines(guide: Guide, shape: tuple[int, ...]) -> npt.NDArray[np.int64]:
    """Pixel columns (rows of a beam that stands upright) that cross the beam's length."""
    ends = guide.pixels(np.array([[0.02 * guide.length, 0.0], [guide.length, 0.0]]))
    axis = 0 if guide.upright else 1
    low, high = np.sort(ends[:, axis])
    if guide.free_tilt:
        low, high = ends[0, axis] - (high - low), ends[0, axis] + (high - low)
    limit = shape[1] if guide.upright else shape[0]
    low, high = max(low, 0), min(high, limit - 1)
    return np.unique(np.linspace(low, high, LINES).astype(np.int64))


def _shape(x: Floats, load: float, tilt: float, x_c: float) -> Floats:
    bent = load * unit_deflection(x, x_c) if load else np.zeros_like(x)
    return np.asarray(bent + tilt * x)


@njit(cache=True, error_model="numpy")
def _unit(x: float, x_c: float) -> float:
    if x_c >= STRAIGHT:
        return 0.0
    return (3 * x_c - x) * x * x if x <= x_c else (3 * x - x_c) * x_c * x_c


@njit(cache=True, error_model="numpy")
def _consensus(
    x: Floats,
    y: Floats,
    line: npt.NDArray[np.int64],
    weight: Floats,
    lines: int,
    anchors: npt.NDArray[np.int64],
    distances: Floats,
    near: float,
    most_tilt: float,
) -> tuple[float, float, float, float]:
    """(load, tilt, x_c, score) of the shape on which most lines agree."""
    best_load = best_tilt = best = 0.0
    best_distance = distances[0]
    got = np.zeros(lines)
    for x_c in distances:
        for i in range(len(anchors)):
            # A pair of one candidate with itself is the straight beam through it.
            partners = len(anchors) if most_tilt > 0 and x_c < STRAIGHT else i + 1
            for j in range(i, partners):
                load, tilt = _through(x, y, anchors[i], anchors[j], x_c, most_tilt)
                if abs(tilt) > most_tilt:
                    continue
                score = _agreement(x, y, line, weight, got, near, load, tilt, x_c)
                if score > best:
                    best, best_load, best_tilt, best_distance = score, load, tilt, x_c
    return best_load, best_tilt, best_distance, best


@njit(cache=True, error_model="numpy")
def _through(
    x: Floats, y: Floats, a: int, b: int, x_c: float, most_tilt: float
) -> tuple[float, float]:
    """Load and tilt of the beam through two candidates; without tilt, through the first.

    A tilt beyond all bounds where they do not tell.
    """
    ua = _unit(x[a], x_c)
    if most_tilt <= 0:
        return y[a] / ua, 0.0
    if a == b:
        return 0.0, y[a] / x[a]
    ub = _unit(x[b], x_c)
    det = ua * x[b] - ub * x[a]
    if abs(det) < 1e-3 * abs(ua * x[b]) or abs(x[a] - x[b]) < 0.1 * x_c:
        return 0.0, np.inf
    return (y[a] * x[b] - y[b] * x[a]) / det, (ua * y[b] - ub * y[a]) / det


@njit(cache=True, error_model="numpy")
def _agreement(
    x: Floats,
    y: Floats,
    line: npt.NDArray[np.int64],
    weight: Floats,
    got: Floats,
    near: float,
    load: float,
    tilt: float,
    x_c: float,
) -> float:
    """Sum over scan lines of the best candidate near the shape; `got` is room to work in."""
    got[:] = 0.0
    for k in range(len(x)):
        r = (y[k] - load * _unit(x[k], x_c) - tilt * x[k]) / near
        if r * r < 1:
            got[line[k]] = max(got[line[k]], weight[k] * (1 - r * r))
    return float(got.sum())
