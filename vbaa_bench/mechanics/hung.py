"""Equilibrium of a beam from which a weight hangs: a dead load at a place of its axis.

Its force is constant in the world, whatever the beam's tangent. The only unknown is the clamp's
moment; the moment behind the place, or at the tip of a beam with a weight of its own, must vanish.
The force is raised in strides, each of which starts from the one before.
"""

import math
from collections.abc import Callable, Sequence

import numpy as np
from scipy.optimize import root

from solver.instrument.arrays import Floats
from vbaa_bench.mechanics.rod import ORDER, Rod, trace
from vbaa_bench.mechanics.rod_contact import Motor
from vbaa_bench.mechanics.state import Contact, EquilibriumError, State, check_residual

# Largest stride of the slope at the load by linear theory. Chosen: every third of it converges, up
# to forces at which the beam hangs down.
_STRIDE = 0.3
# Least angle [rad] between the force and the beam, whose normal is otherwise undefined.
_MIN_ANGLE = 1e-6


def hang(
    rod: Rod, motor: Motor, s: float, force: Floats, angles: Sequence[float], intervals: int = 480
) -> list[State]:
    """Compute the states of a beam with a load, one per rotation of the motor [rad].

    The load `force` (3,) [N] acts at arc length `s` [m]. It is in the world, which is the frame of
    the clamp before the rotation. Each centreline has `intervals` + 1 rows, one of them at the
    load. Raises EquilibriumError if the load is beyond the tip, or if no state is found.
    """
    if not 0 < s <= rod.beam.length:
        raise EquilibriumError(
            f"the weight hangs at {s:.6g} m, allowed is up to the tip at {rod.beam.length:.6g} m"
        )
    return [
        _state(
            rod, motor.clamp_from_world(angle, (0.0, 0.0, 0.0))[:3, :3], s, force, angle, intervals
        )
        for angle in angles
    ]


def _state(
    rod: Rod, turned: Floats, s: float, force: Floats, angle: float, intervals: int
) -> State:
    length, unit = rod.beam.length, rod.force_unit
    place, load = s / length, turned @ force / unit
    own = rod.total_weight(turned)
    row = intervals if place == 1 else min(max(round(place * intervals), 1), intervals - 1)
    rows = np.concatenate(
        [np.linspace(0, place, row + 1), np.linspace(place, 1, intervals - row + 1)[1:]]
    )
    properties = rod.properties(turned)
    # Without a weight of its own the beam is unloaded ahead of the load: a thin end, which a moment
    # that trial values leave would roll up, is left out.
    end = place if not own.any() else 1.0
    ends = np.array([place] if end == place else [place, 1.0])

    def traced(moment: Floats, share: float, at: Floats, steps: int) -> Floats:
        stops, forces, couples = np.array([place]), share * load[None], np.zeros((1, 3))
        return trace(rod.clamp(moment), stops, forces, couples, at, properties, steps)

    def left(moment: Floats, share: float) -> Floats:
        return np.asarray(traced(moment, share, ends, rod.steps)[-1, 9:])

    strides = max(math.ceil(float(np.linalg.norm(load)) * place**2 / 2 / _STRIDE), 1)
    per_stride = np.cross([place, 0.0, 0.0], load) / strides
    path = [_solved(left, rod.weight_moment(turned), 0.0)]
    for number in range(1, strides + 1):
        start = path[-1] + per_stride if number == 1 else 2 * path[-1] - path[-2]
        path.append(_solved(left, start, number / strides))
    moment = path[-1]
    steps = math.ceil(rod.steps / (2 * intervals))
    states = traced(moment, 1.0, rows, steps)
    fine, coarse = (traced(moment, 1.0, ends, count)[-1] for count in (rod.steps, rod.steps // 2))
    scale = float(np.abs(moment).max(initial=1e-300))
    truncation = np.abs(fine - coarse) / (2**ORDER - 1)
    residual = float(max(np.abs(fine[9:]).max(), truncation[9:].max()) / scale)
    check_residual(residual, "no equilibrium under the weight")
    tangent = states[row, 6:9] / np.linalg.norm(states[row, 6:9])
    across = load - (load @ tangent) * tangent
    size = float(np.linalg.norm(across))
    if size < _MIN_ANGLE * float(np.linalg.norm(load)):
        raise EquilibriumError(
            "the beam hangs straight down at the weight, allowed is a lighter one"
        )
    contact = Contact(
        s=s,
        point=states[row, :3] * length,
        tangent=tangent,
        normal=across / size,
        lever=np.zeros(3),
        force=load * unit,
        object_shift=np.zeros(3),
        row=row,
    )
    base_force = -(load + own) * unit
    return State.of_rod(rod, rows, states, angle, (contact,), base_force, residual)


def _solved(left: Callable[[Floats, float], Floats], start: Floats, share: float) -> Floats:
    """Find the clamp's moment (3,) at a share of the load."""
    # Trial values may overflow; a residual that is not finite is an error of the caller.
    with np.errstate(over="ignore", invalid="ignore"):
        return np.asarray(root(left, start, (share,), "hybr", options={"xtol": 1e-14}).x)
