"""Detection of the beam among the thin objects in an image: sample consensus over bent beams.

Every scan line crosses a few thin objects. A beam clamped at a known place is straight, or bends as
y = tilt x + load u(x; x_c) with the unit deflection u of eqs. (9) and (10). The beam is the shape
on which most scan lines agree (MSAC: Torr and Zisserman 2000, over contact distances and candidates
instead of random draws). Linear theory is off by a pixel where the beam bends far: the path is the
shape plus a smooth curve through the candidates beside it.
"""

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from solver.centreline.candidates import candidates
from solver.centreline.guide import Guide
from solver.centreline.noise import Noise
from solver.centreline.smooth import curve
from solver.centreline.thresholds import LIMITS
from solver.instrument.arrays import Floats, Grey
from solver.instrument.compiled import njit
from solver.instrument.dot_products import FAST

# Number of scan lines over the beam's length, and trial contact distances over that length.
LINES, DISTANCES = 72, np.linspace(0.08, 1.0, 12)
# Number of places of a path, and the last one over the beam's length.
PLACES, PATH_END = 96, 1.06
# Number of candidates tried as points of the beam.
ANCHORS = 60
# Degree of the smooth curve beside the shape. A numpy scalar is compiled once, a literal anew.
_DEGREE = np.int64(3)
# Contact distance [m] that represents a beam that does not bend.
STRAIGHT = 1e9


@dataclass(frozen=True)
class Path:
    """Path of the beam, to about a pixel: places (n, 2) [m] of the beam's frame, evenly along x.

    `contrast` [gray] is its median contrast, `support` the fraction of scan lines that agree on it.
    """

    places: Floats
    contrast: float
    support: float


def find_path(
    image: Grey, guide: Guide, polarity: int, noise: Noise, max_tilt: float, bends: bool
) -> Path | None:
    """Find the beam's path in an image (height, width); return None where there is none.

    `max_tilt` [rad] is the largest turn of the beam about its clamp; `bends` also allows bending.
    """
    lines = _scan_lines(guide, image.shape)
    core = max(2, round(2 * guide.radius_px))
    detections = candidates(image, lines, guide.scans_columns, core, polarity, noise)
    pixels = detections[:, :2] if guide.scans_columns else detections[:, 1::-1]
    places = guide.places(np.ascontiguousarray(pixels))
    tolerance = max(LIMITS.near_px, LIMITS.near_radii * guide.radius_px) * guide.pixel
    distances = guide.length * DISTANCES if bends else np.array([STRAIGHT])
    path = _path(places, detections[:, 0], detections[:, 2], guide, distances, tolerance, max_tilt)
    return path and replace(path, support=path.support / len(lines))


def _scan_lines(guide: Guide, shape: tuple[int, ...]) -> npt.NDArray[np.int64]:
    """Return the pixel columns (rows for an upright beam) that cross the beam's length."""
    axis = 0 if guide.scans_columns else 1
    near, far = guide.ends[:, axis]
    low, high = min(near, far), max(near, far)
    if guide.free_tilt:
        low, high = near - (high - low), near + (high - low)
    limit = shape[1] if guide.scans_columns else shape[0]
    low, high = max(low, 0), min(high, limit - 1)
    lines = np.linspace(low, high, LINES).astype(np.int64)
    return np.asarray(lines[np.append(True, lines[1:] != lines[:-1])])


def _path(
    places: Floats,
    line: Floats,
    strength: Floats,
    guide: Guide,
    distances: Floats,
    tolerance: float,
    max_tilt: float,
) -> Path | None:
    """Find the path through candidates, whose `places` (m, 2) are in the order of the scan lines.

    Its support is the number of agreeing scan lines.
    """
    length = guide.length
    x, y = places.T
    inside = (x > 0.02 * length) & (x < 1.02 * length) & (np.abs(y) < 0.8 * length)
    if np.count_nonzero(inside) < LIMITS.min_lines:
        return None
    x, y, line, strength = x[inside], y[inside], line[inside], strength[inside]
    # Anchors far from the clamp constrain the shape most; the strongest come first.
    anchors = np.argsort(-strength * x)[:ANCHORS]
    # The weight of an object much brighter than most is limited.
    weight = np.minimum(strength, np.median(strength))
    load, tilt, x_c, score = _consensus(x, y, line, weight, anchors, distances, tolerance, max_tilt)
    if score <= 0:
        return None
    offset = y - _shape(x, load, tilt, x_c)
    agreed = np.abs(offset) < tolerance
    lines = line[agreed]
    n_agreeing = 1 + np.count_nonzero(lines[1:] != lines[:-1])
    if not agreed.any() or n_agreeing < LIMITS.min_lines:
        return None
    half_px = np.full(len(lines), 0.5 * guide.pixel)
    along = np.linspace(0.0, PATH_END * length, PLACES)
    across = _shape(along, load, tilt, x_c)
    correction = curve(x[agreed], offset[agreed], half_px, along, _DEGREE, LIMITS.tukey_cut)
    if len(correction) > 0:
        across += correction
    contrast = float(np.median(strength[agreed]))
    return Path(np.column_stack([along, across]), contrast, float(n_agreeing))


@njit
def _shape(x: Floats, load: float, tilt: float, x_c: float) -> Floats:
    y = np.empty(len(x))
    for i in range(len(x)):
        y[i] = load * _unit_deflection(x[i], x_c) + tilt * x[i]
    return y


@njit
def _unit_deflection(x: float, x_c: float) -> float:
    """Compute the unit deflection of eqs. (9) and (10); 0 for a beam that does not bend."""
    if x_c >= STRAIGHT:
        return 0.0
    return (3 * x_c - x) * x * x if x <= x_c else (3 * x - x_c) * x_c * x_c


@njit
def _consensus(
    x: Floats,
    y: Floats,
    line: Floats,
    weight: Floats,
    anchors: npt.NDArray[np.int64],
    distances: Floats,
    tolerance: float,
    max_tilt: float,
) -> tuple[float, float, float, float]:
    """Find the shape on which most lines agree; return (load, tilt, x_c, score)."""
    best_load = best_tilt = best_score = 0.0
    best_distance = distances[0]
    unit, gain = np.empty(len(x)), np.empty(len(x))
    for x_c in distances:
        for k in range(len(x)):
            unit[k] = _unit_deflection(x[k], x_c)
        for i in range(len(anchors)):
            # A pair of a candidate with itself gives the straight beam through it.
            partners = len(anchors) if max_tilt > 0 and x_c < STRAIGHT else i + 1
            for j in range(i, partners):
                load, tilt = _load_and_tilt(x, y, unit, anchors[i], anchors[j], x_c, max_tilt)
                if abs(tilt) > max_tilt:
                    continue
                if _gains(x, y, unit, weight, tolerance, load, tilt, gain) <= best_score:
                    continue
                score = _best_of_lines(gain, line)
                if score > best_score:
                    best_score, best_load, best_tilt, best_distance = score, load, tilt, x_c
    return best_load, best_tilt, best_distance, best_score


@njit
def _load_and_tilt(
    x: Floats, y: Floats, unit: Floats, a: int, b: int, x_c: float, max_tilt: float
) -> tuple[float, float]:
    """Compute load and tilt of the beam through two candidates; without tilt, through the first.

    The tilt is infinite where the candidates do not determine it.
    """
    if max_tilt <= 0:
        return y[a] / unit[a], 0.0
    if a == b:
        return 0.0, y[a] / x[a]
    det = unit[a] * x[b] - unit[b] * x[a]
    if abs(det) < 1e-3 * abs(unit[a] * x[b]) or abs(x[a] - x[b]) < 0.1 * x_c:
        return 0.0, np.inf
    return (y[a] * x[b] - y[b] * x[a]) / det, (unit[a] * y[b] - unit[b] * y[a]) / det


@njit(fastmath=FAST)
def _gains(
    x: Floats,
    y: Floats,
    unit: Floats,
    weight: Floats,
    tolerance: float,
    load: float,
    tilt: float,
    gain: Floats,
) -> float:
    """Write the score of each candidate for a shape into `gain`; return their sum."""
    total = 0.0
    for k in range(x.size):
        r = (y[k] - load * unit[k] - tilt * x[k]) / tolerance
        gain[k] = weight[k] * max(1 - r * r, 0.0)
        total += gain[k]
    return total


@njit
def _best_of_lines(gain: Floats, line: Floats) -> float:
    """Sum the best gain of each scan line; candidates are in the order of the lines."""
    total = best = 0.0
    for k in range(len(gain)):
        if k > 0 and line[k] != line[k - 1]:
            total += best
            best = 0.0
        best = max(best, gain[k])
    return total + best
