"""A beam's shape as a curve with gradients by its parameters, integrated step by step.

A state y (3,) is (u, P, psi): the place across and along a force's line, and the beam's angle to
the axis across it. `by` (k, 3) are its gradients by k parameters. Both are advanced together by the
classical method of Runge and Kutta, of order 4.
"""

from typing import Any, Final, NamedTuple

import numpy as np

from solver.instrument.arrays import Floats
from solver.instrument.compiled import njit

# Rows of a curve: u, P, dP/du, d2P/du2.
U, P, SLOPE, BEND = range(4)
# The curve continues straight, or with its bow, to this arc length. Chosen: a tip that is seen a
# little too far is still followed.
END: Final = 1.05
# Largest angle to the axis [rad], whose tangent the curve needs. Chosen, as MOST_SINE in `exact`.
MOST_ANGLE: Final = 1.47


class Curve(NamedTuple):
    """A shape's curve, and its gradients by the shape's parameters (k,).

    `nodes` (4, m) has the rows U, P, SLOPE, BEND, u increasing from beyond the tip to the clamp.
    `gradients` (k, 2, m) are those of P, and of its slope, at constant u. `contact` is the index of
    the contact's node, `by_arm` (k,) the gradient of its u. `base` (3,) is (u, P, psi) at the
    clamp, with the gradients `by_base` (k, 3). `exists` is False for a shape that no beam has;
    nothing else is then valid.
    """

    nodes: Floats
    gradients: Floats
    contact: int
    by_arm: Floats
    base: Floats
    by_base: Floats
    exists: Any


@njit
def shifted(
    y: Floats, by: Floats, rate: Floats, by_rate: Floats, part: float, out: Floats, by_out: Floats
) -> None:
    """Write the state and gradients after a `part` of a step at a constant rate (3,), (k, 3)."""
    for j in range(3):
        out[j] = y[j] + part * rate[j]
        for i in range(len(by)):
            by_out[i, j] = by[i, j] + part * by_rate[i, j]


@njit
def advance(y: Floats, by: Floats, rates: Floats, by_rates: Floats, h: float) -> None:
    """Advance state and gradients by a step h with the rates (4, 3), (4, k, 3) of its stages."""
    for j in range(3):
        y[j] += h / 6 * (rates[0, j] + 2 * (rates[1, j] + rates[2, j]) + rates[3, j])
        for i in range(len(by)):
            middle = by_rates[1, i, j] + by_rates[2, i, j]
            by[i, j] += h / 6 * (by_rates[0, i, j] + 2 * middle + by_rates[3, i, j])


@njit
def write_node(
    y: Floats, by: Floats, curvature: float, column: int, nodes: Floats, gradients: Floats
) -> None:
    """Write a node: dP/du = tan(psi), d2P/du2 = psi' / cos^3(psi), gradients at constant u.

    `curvature` is psi' by the arc length.
    """
    secant, tangent = 1 / np.cos(y[2]), np.tan(y[2])
    bend = curvature * secant**3
    nodes[U, column], nodes[P, column] = y[0], y[1]
    nodes[SLOPE, column], nodes[BEND, column] = tangent, bend
    for i in range(len(by)):
        gradients[i, 0, column] = by[i, 1] - tangent * by[i, 0]
        gradients[i, 1, column] = secant * secant * by[i, 2] - bend * by[i, 0]


@njit(inline="always")
def interpolated(nodes: Floats, i: int, u: float) -> Any:
    """Interpolate between nodes i and i + 1 (Hermite): P and slope; weights of the gradients.

    The four weights multiply the gradients of P and those of its slope, at both nodes in turn.
    """
    h = nodes[U, i + 1] - nodes[U, i]
    t = (u - nodes[U, i]) / h
    r = 1 - t
    # Quintic: value, slope and bend agree at both nodes.
    t3, r3 = t * t * t, r * r * r
    first = r3 * (1 + t * (3 + 6 * t))
    last = t3 * (1 + r * (3 + 6 * r))
    first_slope, last_slope = r3 * t * (1 + 3 * t), -t3 * r * (1 + 3 * r)
    first_bend, last_bend = r3 * t * t / 2, t3 * r * r / 2
    value = (
        nodes[P, i] * first
        + nodes[P, i + 1] * last
        + h * (nodes[SLOPE, i] * first_slope + nodes[SLOPE, i + 1] * last_slope)
        + h * h * (nodes[BEND, i] * first_bend + nodes[BEND, i + 1] * last_bend)
    )
    # The slope by its own cubic, through slope and bend.
    tangent = (
        nodes[SLOPE, i] * r * r * (1 + 2 * t)
        + nodes[SLOPE, i + 1] * t * t * (1 + 2 * r)
        + h * (nodes[BEND, i] * r * r * t - nodes[BEND, i + 1] * t * t * r)
    )
    weights = (r * r * (1 + 2 * t), h * r * r * t, t * t * (1 + 2 * r), -h * t * t * r)
    return value, tangent, weights
