"""Line of the bent beam on plane C: normals, turn since rest, and the bow at rest along it."""

import math
from typing import Any, NamedTuple

import numpy as np

from solver.at_rest.rest_line import RestLine
from solver.instrument.arrays import Floats
from solver.instrument.compiled import njit
from solver.instrument.rig import Rig
from solver.instrument.small_matrices import dot

# Powers of the distance that describe a bent beam across its direction at the clamp (the first
# SHORT_TERMS for a short stretch), and the fewest points of such a fit.
FIRST_POWER, TERMS, SHORT_TERMS, MIN_POINTS = 2, 5, 2, 8
# Steps of the arc length's integral along the beam. Derived: at a slope of 1 its error is 1e-5.
ARC_STEPS = 60
# Part of a power's column that the columns before it leave over, below which it is not used.
# Chosen: rounding leaves 1e-16.
INDEPENDENT = 1e-10


class BentLine(NamedTuple):
    """The bent beam at n points, and the errors at rest that follow it.

    `normals` (n, 2) are unit vectors on C, `turn` (n,) [rad] is the direction less that at rest,
    and `arc` (n,) the arc length from the clamp over the beam's. `beside` (n,) [m], the points'
    deviations from a smooth course, `bow` (n,) [m] and `bow_errors` (n, 5) [m] are along the
    normals.
    """

    normals: Floats
    turn: Floats
    arc: Floats
    beside: Floats
    bow: Floats
    bow_errors: Floats


def bent_line(points: Floats, rest: RestLine, rig: Rig) -> BentLine | None:
    """Compute the line of the beam with points (n, 2) [m] on C; None for too few points.

    A bow moves every point of the bent beam along its normal there, by as much as at rest. Arc
    lengths and normals are those of a smooth curve through the points that leaves the clamp as the
    beam at rest does, so that they also hold where the beam's first part is hidden.
    """
    if len(points) < MIN_POINTS:
        return None
    x, y = points[:, 0] - rig.base_position[0], points[:, 1] - rest.y_at_clamp
    normals, turn, arc, beside, bow, bow_errors = _bent_line(
        x / rest.length, y / rest.length, rest.slope, rest.bow, rest.error_coefficients
    )
    return BentLine(normals, turn, arc, beside * rest.length, bow, bow_errors)


@njit
def _bent_line(x: Floats, y: Floats, slope: float, bow: Floats, errors: Floats) -> Any:
    """Compute the fields of `BentLine` at x (n,), y (n,) over the length.

    `bow` (3,) [m] are the coefficients of x^2 to x^4, `errors` (5, 5) [m] those of 1 to x^4 for
    each error.
    """
    n = len(x)
    terms = TERMS if x.max() - x.min() > 1 / 3 else SHORT_TERMS
    weights = _fitted(x, y - slope * x, terms)
    end = max(1.0, x.max())
    step = end / ARC_STEPS
    arcs = np.zeros(ARC_STEPS + 1)
    before = math.hypot(1.0, _slope(0.0, slope, weights))
    for k in range(1, ARC_STEPS + 1):
        here = math.hypot(1.0, _slope(k * step, slope, weights))
        arcs[k] = arcs[k - 1] + (before + here) / 2 * step
        before = here
    normals, turn, arcs_there, beside = np.empty((n, 2)), np.empty(n), np.empty(n), np.empty(n)
    bows, bow_errors = np.zeros(n), np.zeros((n, errors.shape[1]))
    for i in range(n):
        here = _slope(x[i], slope, weights)
        length = math.hypot(1.0, here)
        normals[i, 0], normals[i, 1] = -here / length, 1 / length
        turn[i] = math.atan(here) - math.atan(slope)
        # Arc length from the clamp, of which the bow is a function.
        k = min(max(int(x[i] / step), 0), ARC_STEPS - 1)
        part = max(x[i] / step - k, 0.0)
        arc = min(arcs[k] + part * (arcs[k + 1] - arcs[k]), 1.0)
        arcs_there[i] = arc
        beside[i] = (y[i] - _height(x[i], slope, weights)) / length
        power = 1.0
        for j in range(errors.shape[0]):
            if j >= FIRST_POWER:
                bows[i] += bow[j - FIRST_POWER] * power
            for m in range(errors.shape[1]):
                bow_errors[i, m] += errors[j, m] * power
            power *= arc
    return normals, turn, arcs_there, beside, bows, bow_errors


@njit
def _height(x: float, slope: float, weights: Floats) -> float:
    power, total = x, slope * x
    for j in range(len(weights)):
        power *= x
        total += weights[j] * power
    return total


@njit
def _slope(x: float, slope: float, weights: Floats) -> float:
    power, total = x, slope
    for j in range(len(weights)):
        total += (j + FIRST_POWER) * weights[j] * power
        power *= x
    return total


@njit
def _subtract(values: Floats, factor: float, others: Floats) -> None:
    """Subtract `factor` times `others` (n,) from `values` (n,)."""
    for i in range(len(values)):
        values[i] -= factor * others[i]


@njit
def _fitted(x: Floats, y: Floats, terms: int) -> Floats:
    """Fit y = sum of w_j x^(j + 2) by least squares; return w (terms,).

    The columns are made orthogonal (modified Gram and Schmidt; Bjoerck 1967): normal equations lose
    their digits where only the beam's last third is seen.
    """
    n = len(x)
    columns, upper = np.empty((terms, n)), np.zeros((terms, terms))
    weights, rest, power = np.zeros(terms), y.copy(), x.copy()
    # Loops, because each expression of whole arrays takes tenths of a second to compile.
    for j in range(terms):
        column = columns[j]
        for i in range(n):
            power[i] *= x[i]  # the first one is x^FIRST_POWER
            column[i] = power[i]
        before = math.sqrt(dot(column, column))
        for k in range(j):
            upper[k, j] = dot(columns[k], column)
            _subtract(column, upper[k, j], columns[k])
        left = math.sqrt(dot(column, column))
        if left <= INDEPENDENT * before:
            column[:] = 0.0
            continue
        upper[j, j] = left
        for i in range(n):
            column[i] /= left
        weights[j] = dot(column, rest)
        _subtract(rest, weights[j], column)
    for j in range(terms - 1, -1, -1):
        if upper[j, j] == 0.0:
            continue
        for k in range(j + 1, terms):
            weights[j] -= upper[j, k] * weights[k]
        weights[j] /= upper[j, j]
    return weights
