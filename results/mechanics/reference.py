"""Reference solution of the planar beam by scipy's integrator: slow and independent."""

import math
from typing import Final

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, root

from solver.instrument.arrays import Floats
from solver.instrument.beam import Beam, circular_rigidity
from vbaa_bench.mechanics.state import State

YOUNGS_MODULUS: Final = 200e9
BEAM: Final = Beam(0.24, 0.8e-3, circular_rigidity(YOUNGS_MODULUS, 0.8e-3))

Push = tuple[float, float]


def reference(push: Push, state: State) -> tuple[Floats, float, Floats]:
    """Compute force (3,) [N], s_c [m] and centreline (n, 3) [m] of a planar push by scipy.

    `state`, changed by one per cent, is the start of the search; it also gives the centreline's
    arc lengths.
    """
    length, unit = BEAM.length, BEAM.flexural_rigidity / BEAM.length**2
    x_0, radius = push[0] / length, BEAM.radius / length

    def contact(strength: float, s_c: float) -> tuple[float, float, float]:
        theta, _, along, across = _integrate(strength, s_c)[:, -1]
        cosine, sine = math.cos(theta), math.sin(theta)
        return theta, along * cosine + across * sine, along * sine - across * cosine

    def errors(unknowns: Floats) -> list[float]:
        strength, s_c, angle = unknowns
        theta, x, y = contact(strength, s_c)
        return [
            x + radius * math.sin(theta) - x_0 * math.cos(angle) - radius * math.sin(angle),
            y - radius * math.cos(theta) - x_0 * math.sin(angle) + radius * math.cos(angle),
            y + (1 - s_c) * math.sin(theta) - push[1],
        ]

    strength = float(np.linalg.norm(state.contact.force)) / unit
    guess = np.array([strength, state.contact.s / length, state.pushing_angle])
    strength, s_c, _ = root(errors, 1.01 * guess, method="hybr", options={"xtol": 1e-14}).x
    theta, x, y = contact(strength, s_c)
    tangent = np.array([math.cos(theta), math.sin(theta)])
    normal = np.array([-math.sin(theta), math.cos(theta)])
    back = s_c - state.centreline[:, 0] / length
    curved = np.clip(back[state.contact.row :: -1], 0.0, s_c)
    _, _, along, across = _integrate(strength, s_c, at=curved)[:, ::-1]
    offsets = np.column_stack([-back, 0 * back])
    offsets[: len(curved)] = np.column_stack([-along, across])
    points = np.array([x, y]) + offsets[:, :1] * tangent + offsets[:, 1:] * normal
    force = unit * strength * np.array([*normal, 0.0])
    return force, s_c * length, length * np.column_stack([points, 0 * back])


def dead_load_tip(load: float) -> Floats:
    """Compute the tip (3,) over L under a dead load [EI / L^2] (Bisshopp and Drucker 1945)."""
    slope = brentq(lambda slope: _integrate(load, 1.0, slope)[0, -1] - slope, 0.01, 1.5, xtol=1e-14)
    _, _, along, across = _integrate(load, 1.0, slope)[:, -1]
    cosine, sine = math.cos(slope), math.sin(slope)
    return np.array([along * cosine + across * sine, along * sine - across * cosine, 0.0])


def _integrate(
    force: float, end: float, load_angle: float = 0.0, at: Floats | None = None
) -> Floats:
    """Integrate the beam back from the force; return (phi, phi', along, across) as (4, n).

    phi'' = force cos(phi - load_angle), lengths in L and force in EI / L^2; `along` and `across`
    are in the frame of the tangent there.
    """
    solution = solve_ivp(
        lambda _, y: (y[1], force * math.cos(y[0] - load_angle), math.cos(y[0]), math.sin(y[0])),
        (0.0, end),
        np.zeros(4),
        method="DOP853",
        rtol=1e-13,
        atol=1e-18,
        max_step=0.02,
        t_eval=at,
    )
    return np.asarray(solution.y)
