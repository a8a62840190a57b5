"""Detection of the beam among the thin objects in an image: sample consensus over bent beams.

Every scan line crosses a few thin objects. A beam clamped at a known place is straight, or bends as
y = tilt x + load u(x; x_c) with the unit deflection u of eqs. (9) and (10). The beam is the shape
on which most scan lines agree (MSAC: Torr and Zisserman 2000, over contact distances and candidates
instead of random draws). Linear theory is off by a pixel where the beam bends far: the path is the
shape plus a smooth curve through the candidates beside it.
"""

from typing import Any

import numpy as np
import numpy.typing as npt

from solver.centreline.candidates import candidates
from solver.centreline.guide import PLACES, Guide
from solver.centreline.noise import Noise
from solver.centreline.smooth import curve
from solver.centreline.thresholds import THRESHOLDS
from solver.instrument.arrays import Floats, Grey
from solver.instrument.compiled import FAST, njit
from solver.instrument.medians import median

# Trial contact distances over the beam's length.
DISTANCES = np.linspace(0.08, 1.0, 12)
# Trials between them, over the best of them, and how much nearer their candidates must be. Chosen.
BETWEEN, NEARER = np.linspace(0.85, 1.15, 9), 3
# Number of candidates tried as points of the beam.
ANCHORS = 60
# Degree of the smooth curve beside the shape. A numpy scalar is compiled once, a literal anew.
_DEGREE: Any = np.int64(3)
_NONE: Any = np.int64(0)


def find_path(
    image: Grey, guide: Guide, polarity: int, noise: Noise, max_tilt: float
) -> Floats | None:
    """Find the beam's path in an image (height, width), to about a pixel; None where there is none.

    The path are places (n, 2) [m] of the beam's frame, evenly along x. `max_tilt` [rad] is the
    largest turn of the beam about its clamp.
    """
    lines = guide.scan_lines
    core = max(2, round(2 * guide.radius_px))
    detections = candidates(image, lines, guide.scans_columns, core, polarity, noise)
    pixels = detections[:, :2] if guide.scans_columns else detections[:, 1::-1]
    places = guide.places(np.ascontiguousarray(pixels))
    x, y, line, strength = _within_reach(places, detections, guide.length)
    if len(x) < THRESHOLDS.min_lines:
        return None
    # Anchors far from the clamp constrain the shape most; the strongest come first.
    anchors = np.argsort(-strength * x)[:ANCHORS]
    tolerance = max(THRESHOLDS.near_px, THRESHOLDS.near_radii * guide.radius_px) * guide.pixel
    load, tilt, x_c, score = _consensus(
        x, y, line, strength, anchors, guide.length * DISTANCES, tolerance, max_tilt
    )
    if score > 0:
        # Between the trial distances, a beam that bends far departs from their shapes by pixels.
        load, tilt, x_c, _ = _consensus(
            x, y, line, strength, anchors, x_c * BETWEEN, tolerance / NEARER, max_tilt
        )
    agreed, n_lines = _agreeing(x, y, line, tolerance, load, tilt, x_c)
    if score <= 0 or n_lines < THRESHOLDS.min_lines:
        return None
    along = guide.length * PLACES
    across = _shape(along, load, tilt, x_c)
    half_px = np.full(agreed.shape[1], 0.5 * guide.pixel)
    correction = curve(agreed[0], agreed[1], half_px, along, _DEGREE, THRESHOLDS.tukey_cut)
    if len(correction) > 0:
        across += correction
    return np.column_stack([along, across])


@njit
def _within_reach(places: Floats, detections: Floats, length: float) -> Any:
    """Select the candidates at `places` (m, 2) that the beam can reach.

    Return x and y of their places, their scan lines and their contrasts.
    """
    selected, count = np.empty((4, len(places))), _NONE
    for i in range(len(places)):
        x, y = places[i]
        if 0.02 * length < x < 1.02 * length and abs(y) < 0.8 * length:
            selected[0, count], selected[1, count] = x, y
            selected[2, count], selected[3, count] = detections[i, 0], detections[i, 2]
            count += 1
    return selected[0, :count], selected[1, :count], selected[2, :count], selected[3, :count]


@njit
def _agreeing(
    x: Floats,
    y: Floats,
    line: Floats,
    tolerance: float,
    load: float,
    tilt: float,
    x_c: float,
) -> tuple[Floats, int]:
    """Select the candidates that agree on a shape, which are in the order of the scan lines.

    Return x and distance from the shape of each (2, n), and their number of scan lines.
    """
    agreed, n, n_lines, last_line = np.empty((2, len(x))), 0, 0, -1.0
    offset = y - _shape(x, load, tilt, x_c)
    for k in range(len(x)):
        if abs(offset[k]) < tolerance:
            agreed[0, n], agreed[1, n] = x[k], offset[k]
            n += 1
            n_lines += line[k] != last_line
            last_line = line[k]
    return agreed[:, :n].copy(), n_lines


@njit
def _shape(x: Floats, load: float, tilt: float, x_c: float) -> Floats:
    y = np.empty(len(x))
    for i in range(len(x)):
        y[i] = load * _unit_deflection(x[i], x_c) + tilt * x[i]
    return y


@njit
def _unit_deflection(x: float, x_c: float) -> float:
    """Compute the unit deflection of eqs. (9) and (10)."""
    return (3 * x_c - x) * x * x if x <= x_c else (3 * x - x_c) * x_c * x_c


@njit
def _consensus(
    x: Floats,
    y: Floats,
    line: Floats,
    strength: Floats,
    anchors: npt.NDArray[np.int64],
    distances: Floats,
    tolerance: float,
    max_tilt: float,
) -> tuple[float, float, float, float]:
    """Find the shape on which most lines agree; return (load, tilt, x_c, score)."""
    # The weight of an object much brighter than most is limited.
    weight = np.minimum(strength, median(strength))
    best_load = best_tilt = best_score = 0.0
    best_distance = distances[0]
    unit, gain = np.empty(len(x)), np.empty(len(x))
    for x_c in distances:
        for k in range(len(x)):
            unit[k] = _unit_deflection(x[k], x_c)
        for i in range(len(anchors)):
            # A pair of a candidate with itself gives the straight beam through it.
            partners = len(anchors) if max_tilt > 0 else i + 1
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
