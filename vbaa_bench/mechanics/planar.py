"""Fast path for a round, weightless beam against a frictionless upright edge, in one plane.

Between clamp and contact the exact beam obeys EI theta'' = -F cos(theta - theta_c) with
theta(0) = 0 and theta'(s_c) = 0 (Love 1927, section 262); beyond, it is straight. Integrated
back from the contact in units of lambda = sqrt(EI / F), phi = theta_c - theta obeys

    phi'' = cos(phi),   phi = phi' = 0 at the contact,

for every beam and force: shapes differ only in the length of integration, tau = s_c / lambda.
The equation is integrated by its Taylor series. Newton's method then finds (tau, lambda,
dtheta) so that the beam's surface touches the object, which is fixed in the world or yields
along a spring. Lengths are in units of L and forces in units of EI / L^2.
"""

import math

import numpy as np

from solver.instrument.arrays import Floats
from solver.instrument.beam import Beam
from solver.instrument.compiled import njit
from solver.instrument.small_matrices import solve
from vbaa_bench.mechanics.state import (
    Contact,
    EquilibriumError,
    State,
    check_on_beam,
    check_residual,
)

ORDER = 16
MAX_STEP = 0.125
# phi reaches a right angle at tau = 1.854: no force turns the beam farther.
_MAX_TAU = 1.8


def push(
    beam: Beam,
    contact_distance: float,
    *,
    deflection: float | None = None,
    pushing_angle: float | None = None,
    object_radius: float = 0.0,
    compliance: float = 0.0,
    spring_heading: float = math.pi / 2,
    intervals: int = 480,
) -> State:
    """Push until y_tip / L is `deflection`, or until the clamp has turned by `pushing_angle`.

    `contact_distance` [m] is where the undeformed beam first touches the object, an upright
    edge, or a cylinder of `object_radius` [m]. The object yields by `compliance` [m/N] along
    `spring_heading` [rad], measured in the world from the resting beam's direction. The
    centreline has `intervals` + 1 rows, one of them exactly at the contact. Raises
    EquilibriumError if no state is found, or if the contact would slip off the tip.
    """
    if (deflection is None) == (pushing_angle is None):
        raise ValueError("give one of deflection and pushing_angle")
    if not (deflection or pushing_angle or 0.0) > 0:
        raise ValueError("deflection or pushing_angle is not positive: the beam touches nothing")
    length, rigidity = beam.length, beam.flexural_rigidity
    force_unit = rigidity / length**2
    offset = beam.radius / length
    tau, scale, angle, residual = _solve(
        contact_distance / length,
        offset + object_radius / length,
        compliance * force_unit / length,
        spring_heading,
        -1.0 if deflection is None else deflection,
        pushing_angle or 0.0,
    )
    failure = f"no equilibrium at contact distance {contact_distance:.6g} m"
    if math.isnan(residual):  # so small a push that numbers underflow
        raise EquilibriumError(f"{failure} (the equations are singular)")
    check_residual(residual, failure)
    s_c = tau * scale
    check_on_beam(s_c * length, length)
    line, row, theta_c, bend = _centreline(tau, scale, intervals)
    magnitude = force_unit / scale**2
    normal = np.array([-math.sin(theta_c), math.cos(theta_c), 0.0])
    towards = np.array([math.cos(spring_heading + angle), math.sin(spring_heading + angle), 0.0])
    force = magnitude * normal
    moment = bend / scale * rigidity / length
    contact = Contact(
        s=s_c * length,
        point=line[row, 1:] * length,
        tangent=np.array([math.cos(theta_c), math.sin(theta_c), 0.0]),
        normal=normal,
        lever=-beam.radius * normal,
        force=force,
        object_shift=-compliance * (force * towards).sum() * towards,
        row=row,
    )
    return State(
        pushing_angle=angle,
        contacts=(contact,),
        base_force=-force,
        base_moment=np.array([0.0, 0.0, -moment]),
        centreline=line * length,
        director=None,
        largest_strain=moment / rigidity * beam.radius,
        residual=residual,
    )


@njit
def walk(tau: float, longest_step: float = MAX_STEP) -> tuple[float, float, float, float]:
    """Integrate over `tau` back from the contact; return (phi, phi', along, across).

    `along` and `across` are the distances in the frame of the contact's tangent. All lengths are
    in units of lambda.
    """
    steps = max(math.ceil(tau / longest_step), 1)
    state = np.zeros(4)
    series = np.empty((3, ORDER + 2))
    for _ in range(steps):
        _expand(state, series)
        _evaluate(series, state, tau / steps)
    return state[0], state[1], state[2], state[3]


@njit
def _expand(state: Floats, series: Floats) -> None:
    """Compute the Taylor coefficients of phi, along and across about a state (Moore 1966)."""
    phi, along, across = series
    phi[0], phi[1], along[0], across[0] = state
    cosine, sine = along, across  # along' = cos phi, across' = sin phi
    c, s = np.empty(ORDER + 1), np.empty(ORDER + 1)
    c[0], s[0] = math.cos(phi[0]), math.sin(phi[0])
    for k in range(ORDER):
        phi[k + 2] = c[k] / ((k + 1) * (k + 2))
        c_next, s_next = 0.0, 0.0
        for j in range(k + 1):
            turn = (j + 1) * phi[j + 1]
            c_next -= turn * s[k - j]
            s_next += turn * c[k - j]
        c[k + 1], s[k + 1] = c_next / (k + 1), s_next / (k + 1)
    for k in range(ORDER + 1):
        cosine[k + 1], sine[k + 1] = c[k] / (k + 1), s[k] / (k + 1)


@njit
def _evaluate(series: Floats, state: Floats, h: float) -> None:
    """Set `state` to the value of `series` at a distance `h` from its point of expansion."""
    phi, bend, along, across = 0.0, 0.0, 0.0, 0.0
    for k in range(ORDER + 1, -1, -1):
        bend = bend * h + phi
        phi = phi * h + series[0, k]
        along = along * h + series[1, k]
        across = across * h + series[2, k]
    state[0], state[1], state[2], state[3] = phi, bend, along, across


@njit
def _solve(
    x_0: float,
    offset: float,
    compliance: float,
    spring_heading: float,
    deflection: float,
    pushing_angle: float,
) -> tuple[float, float, float, float]:
    """Find (tau, lambda, dtheta, residual) of a touching beam.

    The residual is NaN if the equations are singular. A negative deflection means that
    `pushing_angle` is prescribed. `offset` is the distance from the beam's centreline to the edge,
    or to the cylinder's axis.
    """
    # Start from linear theory: y_tip / y_c = (3 L - x_c) / (2 x_c), F = 3 EI y_c / x_c^3.
    give = 1 + 3 * compliance / x_0**3
    y_c = x_0 * math.tan(pushing_angle) / give
    angle = pushing_angle
    if deflection >= 0:
        y_c = deflection * 2 * x_0 / (3 - x_0)
        angle = math.atan(y_c * give / x_0)
    tau = min(math.sqrt(3 * y_c / x_0), 1.2)
    scale = x_0 / tau
    springs = compliance, math.cos(spring_heading), math.sin(spring_heading)
    equations, slopes = np.empty(3), np.empty((3, 3))
    best, stalled = math.inf, 0
    solution = (tau, scale, angle, math.inf)
    for _ in range(60):
        moment = _residuals(tau, scale, angle, x_0, offset, springs, deflection, equations, slopes)
        if deflection < 0:
            equations[2] = angle - pushing_angle
        error = np.abs(equations).max()
        # Moments about the clamp must balance, too. Errors are relative to the deflection y_c.
        residual = max(error / max(y_c, 1e-300), moment)
        if residual < best:
            best, stalled = residual, 0
            solution = (tau, scale, angle, residual)
        else:
            stalled += 1
        if stalled >= 2 or not math.isfinite(error):
            break
        if not solve(slopes, equations):
            return tau, scale, angle, math.nan
        # Go at most half the way to the bounds of tau and lambda.
        fraction = 1.0
        for value, step, low, high in (
            (tau, equations[0], 0.0, _MAX_TAU),
            (scale, equations[1], 0.0, math.inf),
        ):
            if step > 0:
                fraction = min(fraction, 0.5 * (value - low) / step)
            elif step < 0 and high < math.inf:
                fraction = min(fraction, 0.5 * (high - value) / -step)
        fraction = min(1.0, fraction)
        tau -= fraction * equations[0]
        scale -= fraction * equations[1]
        angle -= fraction * equations[2]
    return solution


@njit
def _residuals(
    tau: float,
    scale: float,
    angle: float,
    x_0: float,
    offset: float,
    spring: tuple[float, float, float],
    deflection: float,
    equations: Floats,
    slopes: Floats,
) -> float:
    """Fill in the residuals (3,) and their derivatives (3, 3) with respect to the unknowns.

    `spring` is the object's compliance and direction. Returns the relative error of the moments
    about the clamp. With a negative deflection the third equation prescribes the angle.
    """
    compliance, e_x, e_y = spring
    phi, bend, along, across = walk(tau)
    sine, cosine = math.sin(phi), math.cos(phi)
    p_x, p_y = along * cosine + across * sine, along * sine - across * cosine
    # Centre of the touched edge or cylinder in the clamp's frame, and its derivatives by
    # tau and by lambda.
    q_x, q_y = scale * p_x + offset * sine, scale * p_y - offset * cosine
    tau_x = scale * (1 - bend * p_y) + offset * bend * cosine
    tau_y = scale * bend * p_x + offset * bend * sine
    c, s = math.cos(angle), math.sin(angle)
    force = 1 / scale**2
    # Force along the spring in the world, where the clamp's frame is turned by -angle.
    lean = phi - angle
    push_along = force * (-math.sin(lean) * e_x + math.cos(lean) * e_y)
    push_turn = force * (-math.cos(lean) * e_x - math.sin(lean) * e_y)
    w_x, w_y = q_x * c + q_y * s, -q_x * s + q_y * c
    equations[0] = w_x - x_0 + compliance * push_along * e_x
    equations[1] = w_y + offset + compliance * push_along * e_y
    slopes[0, 0] = tau_x * c + tau_y * s + compliance * push_turn * bend * e_x
    slopes[1, 0] = -tau_x * s + tau_y * c + compliance * push_turn * bend * e_y
    slopes[0, 1] = p_x * c + p_y * s - 2 * compliance * push_along / scale * e_x
    slopes[1, 1] = -p_x * s + p_y * c - 2 * compliance * push_along / scale * e_y
    slopes[0, 2] = w_y - compliance * push_turn * e_x
    slopes[1, 2] = -w_x - compliance * push_turn * e_y
    if deflection < 0:
        slopes[2, 0], slopes[2, 1], slopes[2, 2] = 0.0, 0.0, 1.0
    else:
        ahead = 1 - tau * scale
        equations[2] = scale * p_y + ahead * sine - deflection
        slopes[2, 0] = scale * bend * p_x - scale * sine + ahead * cosine * bend
        slopes[2, 1] = p_y - tau * sine
        slopes[2, 2] = 0.0
    return abs(bend - along) / bend


@njit
def _centreline(tau: float, scale: float, intervals: int) -> tuple[Floats, int, float, float]:
    """Compute rows (s, x, y, z) from clamp to tip, the contact's row, theta_c, and clamp phi'."""
    theta_c, bend, along, across = walk(tau)
    sine, cosine = math.sin(theta_c), math.cos(theta_c)
    x_c, y_c = along * cosine + across * sine, along * sine - across * cosine
    s_c = tau * scale
    row = min(max(round(s_c * intervals), 2), intervals - 1)
    line = np.zeros((intervals + 1, 4))
    series, state = np.empty((3, ORDER + 2)), np.zeros(4)
    _expand(state, series)
    origin = 0.0  # where the series is expanded
    for back in range(row + 1):
        walked = tau * back / row
        if walked - origin > MAX_STEP:
            _evaluate(series, state, walked - origin)
            _expand(state, series)
            origin = walked
        _evaluate(series, state, walked - origin)
        i = row - back
        line[i, 0] = s_c - scale * walked
        line[i, 1] = scale * (x_c - state[2] * cosine - state[3] * sine)
        line[i, 2] = scale * (y_c - state[2] * sine + state[3] * cosine)
    line[0] = 0.0  # exactly the clamp, without rounding errors
    for i in range(row + 1, intervals + 1):
        ahead = (1 - s_c) * (i - row) / (intervals - row)
        line[i, 0] = s_c + ahead
        line[i, 1] = line[row, 1] + ahead * cosine
        line[i, 2] = line[row, 2] + ahead * sine
    return line, row, theta_c, bend
