"""Exact large-deflection equilibrium of a beam pushed against a rigid, frictionless edge.

The clamp turns about the origin, the edge stands fixed in the world. In the frame of the
clamp (Sigma_d) the edge therefore walks along a circle: at pushing angle dtheta its tip is at
R(dtheta) (x_0, -r), r being the beam's radius, and the centreline passes r above it.

Equilibrium (inextensible, unshearable, circular section; Love 1927, section 262):
EI theta'' = -F cos(theta - theta_c), theta(0) = 0, theta'(s_c) = 0, straight beyond s_c.
It is integrated from the contact back to the clamp with phi = theta_c - theta,

    phi'' = (F / EI) cos(phi),  phi = phi' = 0 at the contact,

by an explicit Runge-Kutta method of order 8 (Dormand and Prince; scipy's DOP853), and
(F, s_c, dtheta) are found by Newton's method so that the centreline touches the edge. Inside
this module lengths are in units of L and forces in units of EI / L^2.
"""

from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import root

from solver.instrument.arrays import Floats, frozen_floats
from solver.instrument.beam import Beam

WORST_RESIDUAL = 1e-8
_RELATIVE_TOLERANCE = 1e-13


class EquilibriumError(Exception):
    """No equilibrium was found, or not accurately enough to be called truth."""


@dataclass(frozen=True)
class Equilibrium:
    """A bent beam in Sigma_d; SI and radians.

    `centreline` (n, 4) has columns s, x, y, theta from the clamp to the tip, with one row
    exactly at the contact (`contact_row`). `moment` is the clamp's. `residual` is the larger of
    the contact's closure error over L and the relative imbalance of moments about the clamp.
    """

    beam: Beam
    contact_distance: float
    pushing_angle: float
    x_c: float
    y_c: float
    s_c: float
    theta_c: float
    force: float
    moment: float
    residual: float
    centreline: Floats
    contact_row: int

    def __post_init__(self) -> None:
        line = frozen_floats("centreline", self.centreline, (None, 4))
        object.__setattr__(self, "centreline", line)

    @property
    def tip(self) -> Floats:
        """Tip (x, y) [m]."""
        return np.asarray(self.centreline[-1, 1:3])

    def largest_stress(self, youngs_modulus: float) -> float:
        """Largest bending stress [Pa], at the clamp: E kappa d / 2."""
        curvature = self.moment / self.beam.flexural_rigidity
        return youngs_modulus * curvature * self.beam.radius


def push(
    beam: Beam,
    contact_distance: float,
    *,
    deflection: float | None = None,
    pushing_angle: float | None = None,
    intervals: int = 480,
) -> Equilibrium:
    """Push until y_tip / L is `deflection`, or until the clamp has turned by `pushing_angle`.

    `contact_distance` [m] is where the undeformed beam first touches the edge; the centreline
    has `intervals` + 1 rows. Raises EquilibriumError if no state is found, if its
    residual is above 1e-8, or if the contact would slip off the tip.
    """
    if (deflection is None) == (pushing_angle is None):
        raise ValueError("give one of deflection and pushing_angle")
    x_0 = contact_distance / beam.length
    radius = beam.radius / beam.length

    def mismatch(unknown: Floats) -> Floats:
        force, s_c, angle = unknown
        state = integrate(force, s_c)
        x_gap, y_gap = _gap(state, x_0, radius, angle)
        if deflection is None:
            last = angle - float(pushing_angle or 0.0)
        else:
            _, y_c = _contact(state)
            last = y_c + (1 - s_c) * np.sin(state[0]) - deflection
        return np.array([x_gap, y_gap, last])

    # Linear theory starts the search: y_tip / y_c = (3 L - x_c) / (2 x_c), F = 3 EI y_c / x_c^3.
    y_c = deflection * 2 * x_0 / (3 - x_0) if deflection else x_0 * np.tan(pushing_angle or 0.0)
    start = np.array([3 * y_c / x_0**3, x_0, np.arctan(y_c / x_0)])
    found = root(
        lambda scaled: mismatch(scaled * start), np.ones(3), method="hybr", options={"xtol": 1e-14}
    )
    force, s_c, angle = found.x * start
    state = integrate(force, s_c)
    lever, bend = state[2], state[1]
    closure = max(abs(v) for v in mismatch(np.array([force, s_c, angle])))
    residual = float(max(closure, abs(bend - force * lever) / (force * lever)))
    if not residual <= WORST_RESIDUAL or force <= 0:
        raise EquilibriumError(
            f"no equilibrium at contact distance {contact_distance:.6g} m "
            f"(residual {residual:.1e}, allowed is {WORST_RESIDUAL:.0e})"
        )
    if s_c >= 1:
        raise EquilibriumError(
            f"the beam slips off: contact arc length {s_c * beam.length:.6g} m, "
            f"allowed is up to the tip at {beam.length:.6g} m"
        )
    x_c, y_c = _contact(state)
    rigidity, length = beam.flexural_rigidity, beam.length
    line, contact_row = _centreline(force, s_c, state, intervals)
    line[:, :3] *= length
    return Equilibrium(
        beam=beam,
        contact_distance=contact_distance,
        pushing_angle=float(angle),
        x_c=float(x_c * length),
        y_c=float(y_c * length),
        s_c=float(s_c * length),
        theta_c=float(state[0]),
        force=float(force * rigidity / length**2),
        moment=float(bend * rigidity / length),
        residual=residual,
        centreline=line,
        contact_row=contact_row,
    )


def integrate(force: float, s_c: float, at: Floats | None = None, *, lean: float = 0.0) -> Floats:
    """(phi, phi', along, across) integrated from the contact back over arc length s_c, (4,).

    `along` and `across` are the distances walked in the contact tangent's frame. With `at`
    (n,), the states at those distances from the contact, (4, n). `lean` [rad] turns the force
    counter-clockwise from the beam's normal, phi'' = (F / EI) cos(phi + lean): zero for a
    frictionless edge, atan(mu) with friction, minus theta_c for a dead load.
    """

    def derivative(_: float, state: Floats) -> list[float]:
        phi, bend = state[0], state[1]
        return [bend, force * np.cos(phi + lean), np.cos(phi), np.sin(phi)]

    solution = solve_ivp(
        derivative,
        (0.0, s_c),
        np.zeros(4),
        method="DOP853",
        rtol=_RELATIVE_TOLERANCE,
        atol=1e-18,
        t_eval=at,
    )
    if not solution.success:
        raise EquilibriumError(f"the integration of the beam failed: {solution.message}")
    return np.asarray(solution.y if at is not None else solution.y[:, -1])


def _contact(state: Floats) -> tuple[float, float]:
    """Contact point on the centreline in the clamp's frame, from the state at the clamp."""
    theta_c, _, along, across = state
    sine, cosine = np.sin(theta_c), np.cos(theta_c)
    return along * cosine + across * sine, along * sine - across * cosine


def _gap(state: Floats, x_0: float, radius: float, angle: float) -> tuple[float, float]:
    """Vector from the object's edge to the beam's surface at the contact: zero when they touch."""
    x_c, y_c = _contact(state)
    theta_c = state[0]
    surface = x_c + radius * np.sin(theta_c), y_c - radius * np.cos(theta_c)
    edge = (
        x_0 * np.cos(angle) + radius * np.sin(angle),
        x_0 * np.sin(angle) - radius * np.cos(angle),
    )
    return surface[0] - edge[0], surface[1] - edge[1]


def _centreline(force: float, s_c: float, clamp: Floats, intervals: int) -> tuple[Floats, int]:
    """Rows (s, x, y, theta) from clamp to tip, and the row of the contact; in units of L."""
    contact_row = min(max(round(s_c * intervals), 2), intervals - 1)
    back = np.linspace(0.0, s_c, contact_row + 1)
    phi, _, along, across = integrate(force, s_c, back)
    theta_c = clamp[0]
    sine, cosine = np.sin(theta_c), np.cos(theta_c)
    x_c, y_c = _contact(clamp)
    curved = np.column_stack(
        [
            s_c - back,
            x_c - (along * cosine + across * sine),
            y_c - (along * sine - across * cosine),
            theta_c - phi,
        ]
    )[::-1]
    curved[0] = 0.0  # the clamp itself, to the last digit
    ahead = np.linspace(0.0, 1.0 - s_c, intervals - contact_row + 1)[1:]
    straight = np.column_stack(
        [s_c + ahead, x_c + ahead * cosine, y_c + ahead * sine, np.full(len(ahead), theta_c)]
    )
    return np.vstack([curved, straight]), contact_row


def at_rest(beam: Beam, intervals: int = 480) -> Floats:
    """Centreline rows (s, x, y, theta) of the beam that touches nothing, (intervals + 1, 4)."""
    s = np.linspace(0.0, beam.length, intervals + 1)
    return np.column_stack([s, s, np.zeros_like(s), np.zeros_like(s)])
