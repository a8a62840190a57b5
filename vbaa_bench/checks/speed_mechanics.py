"""How fast each model finds the beam's equilibrium on one core, and how far it errs."""

import importlib
import json
import logging
import math
import os
import subprocess
import sys
from collections.abc import Callable, Sequence
from functools import partial
from statistics import median
from time import perf_counter
from types import ModuleType
from typing import Any, Final

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, root

from solver.instrument.arrays import Floats
from solver.instrument.beam import Beam, circular_rigidity
from solver.instrument.transforms import rigid
from vbaa_bench.mechanics import planar, pushing
from vbaa_bench.mechanics.contact import Obstacle
from vbaa_bench.mechanics.pushing import Motor, Step
from vbaa_bench.mechanics.rod import POISSON, STEPS, Rod, advance
from vbaa_bench.mechanics.state import State
from vbaa_bench.mechanics.surfaces import upright

YOUNGS_MODULUS: Final = 200e9
DENSITY: Final = 7850.0
BEAM: Final = Beam(0.24, 0.8e-3, circular_rigidity(YOUNGS_MODULUS, 0.8e-3))
NOT_INSTALLED: Final = "not installed: pip install 'vbaa-bench[yardstick]'"

# Times each set of states is found; the median time counts.
_REPEATS = 3
_ONE_THREAD = ("OMP", "OPENBLAS", "MKL", "NUMBA")
# The dead load on the yardstick's tip, in EI / L^2: it moves the tip by a fifth of L.
_DEAD_LOAD = 0.625
_ELEMENTS = 50
# Steps between two looks at the yardstick, which rests when no node would move farther than
# this share of L while the slowest mode turns by a radian.
_LOOK = 1000
_REST = 1e-6

Push = tuple[float, float]
Record = dict[str, Any]


def measure_apart(yardstick_seconds: float) -> Record:
    """`measure` in a fresh process whose numerical libraries keep to one thread."""
    environment = os.environ | {f"{name}_NUM_THREADS": "1" for name in _ONE_THREAD}
    command = [sys.executable, "-m", "vbaa_bench.checks.speed_mechanics", str(yardstick_seconds)]
    done = subprocess.run(command, env=environment, stdout=subprocess.PIPE, text=True, check=True)
    record: Record = json.loads(done.stdout)
    return record


def measure(
    yardstick_seconds: float, *, flat: int = 3000, compared: int = 20, spatial: int = 60
) -> Record:
    """States per second, and the error, of every model.

    `flat` pushes go through the fast path and `compared` of them through an integration of
    scipy's; `spatial` go through the rod in space.
    """
    generator = np.random.default_rng(0)
    distances = generator.uniform(0.03, 0.2, max(flat, spatial))
    deflections = generator.uniform(0.02, 0.25, max(flat, spatial))
    pushes = list(zip(distances.tolist(), deflections.tolist(), strict=True))
    record: Record = {
        "planar": _planar(pushes[:flat], compared),
        "space_plain": _space_plain(pushes[:spatial]),
        "space_all_effects": _space_all_effects(pushes[:spatial]),
        "yardstick": yardstick(yardstick_seconds),
    }
    found = record["yardstick"]
    for model in ("planar", "space_plain", "space_all_effects"):
        speed = record[model]["states_per_s"]
        record[model]["times_yardstick"] = found and speed / found["states_per_s"]
    return record


def yardstick(seconds: float) -> Record | None:
    """A cantilever under a dead load, brought to rest by PyElastica; None if it is not installed.

    It stops at rest, or after `seconds` of wall time.
    """
    try:
        elastica = importlib.import_module("elastica")
    except ModuleNotFoundError:
        return None
    start = perf_counter()
    rod, advance_once, slowest = _cantilever(elastica)
    advance_once()
    cold = perf_counter() - start
    start, elapsed, rests, steps = perf_counter(), 0.0, False, 1
    while not rests and elapsed < seconds:
        for _ in range(_LOOK):
            advance_once()
        steps += _LOOK
        speed = float(np.linalg.norm(rod.velocity_collection, axis=0).max())
        rests, elapsed = speed < _REST * slowest * BEAM.length, perf_counter() - start
    error = np.linalg.norm(rod.position_collection[:, -1] / BEAM.length - _dead_load_tip())
    return {
        "states_per_s": 1 / elapsed,
        "tip_error_pct_L": 100 * float(error),
        "at_rest": rests,
        "steps": steps,
        "elements": _ELEMENTS,
        "cold_start_s": cold,
    }


def rows(record: Record) -> list[tuple[str, str, str, str, str]]:
    """Model, states per second, times the yardstick's, worst error, and a remark, to be read."""
    flat, found = record["planar"], record["yardstick"]
    bare, cold = flat["states_per_s_without_centreline"], flat["cold_start_s"]
    remarks = {
        "planar": f"against DOP853; {_three_digits(bare)}/s without centreline; "
        f"first state {cold:.2g} s",
        "space_plain": "the same pushes in space; against planar",
        "space_all_effects": "weight, bow, taper, stretch, ellipse, tilt, spring, friction; "
        "against a finer mesh",
    }
    rests = found is None or found["at_rest"]
    said = []
    for model, remark in remarks.items():
        one = record[model]
        ratio = _three_digits(one["times_yardstick"]) if found else "–"
        error = f"{max(one['worst_relative_error'], one['worst_residual']):.1e}"
        name, speed = model.replace("_", " "), _three_digits(one["states_per_s"])
        said.append((name, speed, ratio if rests else f"> {ratio}", error, remark))
    if found is None:
        return [*said, ("yardstick", "–", "–", "–", NOT_INSTALLED)]
    speed, error = _three_digits(found["states_per_s"]), f"{found['tip_error_pct_L'] / 100:.1e}"
    state = "at rest" if rests else "not yet at rest"
    remark = f"PyElastica, dead load, {state} after {1 / found['states_per_s']:.3g} s; tip over L"
    return [*said, ("yardstick", speed if rests else f"< {speed}", "1", error, remark)]


def _three_digits(number: float) -> str:
    return f"{float(f'{number:.3g}'):,g}"


def _planar(pushes: Sequence[Push], compared: int) -> Record:
    find = partial(_flat, intervals=480)
    cold, speed, states = _timed(find, pushes)
    _, bare, _ = _timed(partial(_flat, intervals=3), pushes)
    return {
        "states_per_s": speed,
        "states_per_s_without_centreline": bare,
        "worst_relative_error": max(
            _difference(state, *_reference(push, state))
            for push, state in zip(pushes[:compared], states[:compared], strict=True)
        ),
        "worst_residual": max(state.residual for state in states),
        "states": len(states),
        "compared": min(compared, len(states)),
        "cold_start_s": cold,
    }


def _space_plain(pushes: Sequence[Push]) -> Record:
    rod = Rod(BEAM)

    def find(push: Push) -> State:
        distance, deflection = push
        edge = Obstacle(upright(), rigid([0.0, 0.0, 0.0], [distance, -BEAM.radius, 0.0]))
        return pushing.push(rod, Motor(), [edge], distance, [Step(deflection=deflection)])[0]

    cold, speed, states = _timed(find, pushes)
    flat = [_flat(push, 480) for push in pushes]
    return {
        "states_per_s": speed,
        "worst_relative_error": max(
            _difference(state, one.contact.force, one.contact.s, one.centreline[:, 1:])
            for state, one in zip(states, flat, strict=True)
        ),
        "worst_residual": max(state.residual for state in states),
        "states": len(states),
        "cold_start_s": cold,
    }


def _space_all_effects(pushes: Sequence[Push]) -> Record:
    weight = DENSITY * math.pi * BEAM.radius**2 * 9.81
    rod = Rod(
        BEAM,
        aspect=1.2,
        section_angle=0.3,
        tip_ratio=0.8,
        weight=(0.0, 0.0, -weight),
        bow=(0.2, 0.1),
        extensible=True,
    )
    resting, tilt = pushing.rest(rod).centreline, math.radians(30)
    normal, lean = np.array([0.0, math.cos(tilt), math.sin(tilt)]), tilt - rod.section_angle
    girth = math.hypot(math.cos(lean), rod.aspect * math.sin(lean))

    def find(push: Push) -> State:
        s, *point = resting[np.searchsorted(resting[:, 0], push[0])]
        place = rigid([tilt, 0.0, 0.0], np.array(point) - girth * rod.half_height(s) * normal)
        edge = Obstacle(upright(), place, compliance=1e-3, friction=0.1)
        return pushing.push(rod, Motor(), [edge], float(s), [Step(deflection=push[1])])[0]

    _, speed, states = _timed(find, pushes)
    return {
        "states_per_s": speed,
        "worst_relative_error": max(_unbalanced(rod, state) for state in states),
        "worst_residual": max(state.residual for state in states),
        "states": len(states),
    }


def _timed(
    find: Callable[[Push], State], pushes: Sequence[Push]
) -> tuple[float, float, list[State]]:
    """Seconds of the first state, which loads or compiles code; states per second; the states."""
    start = perf_counter()
    find(pushes[0])
    cold = perf_counter() - start
    spent = []
    for _ in range(_REPEATS):
        start = perf_counter()
        states = [find(push) for push in pushes]
        spent.append(perf_counter() - start)
    return cold, len(pushes) / median(spent), states


def _flat(push: Push, intervals: int) -> State:
    return planar.push(BEAM, push[0], deflection=push[1], intervals=intervals)


def _difference(state: State, force: Floats, s_c: float, points: Floats) -> float:
    """The largest of a state's relative differences from a contact force (3,) [N], its arc
    length [m], and a centreline (n, 3) [m]; the last counts against the tip's deflection."""
    contact = state.contact
    apart = np.linalg.norm(state.centreline[:, 1:] - points, axis=1).max() / state.tip[1]
    strength = np.linalg.norm(contact.force - force) / np.linalg.norm(force)
    return float(max(apart, strength, abs(contact.s / s_c - 1)))


def _reference(push: Push, state: State) -> tuple[Floats, float, Floats]:
    """Force (3,) [N], s_c [m] and centreline (n, 3) [m] of a planar push by scipy's integrator.

    `state` says where the search starts, a hundredth off, and the centreline's arc lengths.
    """
    length, unit = BEAM.length, BEAM.flexural_rigidity / BEAM.length**2
    x_0, radius = push[0] / length, BEAM.radius / length

    def contact(strength: float, s_c: float) -> tuple[float, float, float]:
        theta, _, along, across = _walk(strength, s_c)[:, -1]
        cosine, sine = math.cos(theta), math.sin(theta)
        return theta, along * cosine + across * sine, along * sine - across * cosine

    def errors(unknown: Floats) -> list[float]:
        strength, s_c, angle = unknown
        theta, x, y = contact(strength, s_c)
        return [
            x + radius * math.sin(theta) - x_0 * math.cos(angle) - radius * math.sin(angle),
            y - radius * math.cos(theta) - x_0 * math.sin(angle) + radius * math.cos(angle),
            y + (1 - s_c) * math.sin(theta) - push[1],
        ]

    strength = float(np.linalg.norm(state.contact.force)) / unit
    near = np.array([strength, state.contact.s / length, state.pushing_angle])
    strength, s_c, _ = root(errors, 1.01 * near, method="hybr", options={"xtol": 1e-14}).x
    theta, x, y = contact(strength, s_c)
    tangent = np.array([math.cos(theta), math.sin(theta)])
    normal = np.array([-math.sin(theta), math.cos(theta)])
    back = s_c - state.centreline[:, 0] / length
    curved = np.clip(back[state.contact.row :: -1], 0.0, s_c)
    _, _, along, across = _walk(strength, s_c, at=curved)[:, ::-1]
    ahead = np.column_stack([-back, 0 * back])
    ahead[: len(curved)] = np.column_stack([-along, across])
    points = np.array([x, y]) + ahead[:, :1] * tangent + ahead[:, 1:] * normal
    force = unit * strength * np.array([*normal, 0.0])
    return force, s_c * length, length * np.column_stack([points, 0 * back])


def _walk(force: float, end: float, lean: float = 0.0, at: Floats | None = None) -> Floats:
    """(phi, phi', along, across) of the beam walked back from the force, (4, n).

    phi'' = force cos(phi - lean), lengths in units of L and the force in EI / L^2; `along` and
    `across` are in the frame of the tangent there.
    """
    solution = solve_ivp(
        lambda _, y: (y[1], force * math.cos(y[0] - lean), math.cos(y[0]), math.sin(y[0])),
        (0.0, end),
        np.zeros(4),
        method="DOP853",
        rtol=1e-13,
        atol=1e-18,
        max_step=0.02,
        t_eval=at,
    )
    return np.asarray(solution.y)


def _unbalanced(rod: Rod, state: State) -> float:
    """How far a state changes on a mesh eight times as fine, under its own forces.

    Places count against the tip's deflection, the moment left at the tip against the clamp's.
    """
    length, unit, contact = rod.beam.length, rod.force_unit, state.contact
    turned = Motor().clamp_from_world(state.pushing_angle, (0.0, 0.0, 0.0))[:3, :3]
    properties, s_c = rod.properties(turned), contact.s / length
    clamp, steps = rod.clamp(-state.base_moment / (unit * length)), 8 * STEPS
    touched = advance(clamp, 0.0, s_c, steps, contact.force / unit, properties)
    moved = touched[:3] * length - contact.point
    touched[9:] -= np.cross(contact.lever, contact.force) / (unit * length)
    tip = advance(touched, s_c, 1.0, steps, np.zeros(3), properties)
    apart = max(np.linalg.norm(moved), np.linalg.norm(tip[:3] * length - state.tip))
    left = np.linalg.norm(tip[9:]) / np.linalg.norm(clamp[9:])
    return float(max(apart / state.tip[1], left))


def _cantilever(elastica: ModuleType) -> tuple[Any, Callable[[], None], float]:
    """PyElastica's rod, what carries it one step on, and the slowest mode's frequency [rad/s].

    It holds its first element fast, so half an element is added there. The rotary inertia is
    raised until the sections' spin, whose stable step would else be the shortest by far, is no
    faster than sound along an element; a beam at rest knows nothing of it.
    """
    element = BEAM.length / (_ELEMENTS - 0.5)
    rod = elastica.CosseratRod.straight_rod(
        _ELEMENTS,
        np.array([-element / 2, 0.0, 0.0]),
        np.array([1.0, 0.0, 0.0]),
        np.array([0.0, 1.0, 0.0]),
        _ELEMENTS * element,
        BEAM.radius,
        DENSITY,
        youngs_modulus=YOUNGS_MODULUS,
        shear_modulus=YOUNGS_MODULUS / (2 * (1 + POISSON)),
    )
    sound = 2 * math.sqrt(YOUNGS_MODULUS / DENSITY) / element
    inertia = rod.mass_second_moment_of_inertia[0, 0, 1]
    raised = max(rod.shear_matrix[0, 0, 1] * element / inertia / sound**2, 1.0)
    rod.mass_second_moment_of_inertia *= raised
    rod.inv_mass_second_moment_of_inertia /= raised
    linear_density = DENSITY * math.pi * BEAM.radius**2
    slowest = 1.8751**2 * math.sqrt(BEAM.flexural_rigidity / linear_density) / BEAM.length**2
    time_step = 0.8 / sound
    parts = ("BaseSystemCollection", "Constraints", "Forcing", "Damping")
    world: Any = type("World", tuple(getattr(elastica, part) for part in parts), {})()
    world.append(rod)
    held = {"constrained_position_idx": (0,), "constrained_director_idx": (0,)}
    world.constrain(rod).using(elastica.OneEndFixedBC, **held)
    force = np.array([0.0, _DEAD_LOAD * BEAM.flexural_rigidity / BEAM.length**2, 0.0])
    load = {"start_force": np.zeros(3), "end_force": force, "ramp_up_time": time_step}
    world.add_forcing_to(rod).using(elastica.EndpointForces, **load)
    # The slowest mode comes to rest soonest when it is damped critically.
    damping = {"uniform_damping_constant": 2 * slowest, "time_step": time_step}
    world.dampen(rod).using(elastica.AnalyticalLinearDamper, **damping)
    world.finalize()
    stepper, now = elastica.PositionVerlet(), 0.0

    def advance_once() -> None:
        nonlocal now
        now = stepper.step(world, now, time_step)

    return rod, advance_once, slowest


def _dead_load_tip() -> Floats:
    """The exact tip (3,) over L under the dead load (Bisshopp and Drucker 1945)."""
    slope = brentq(
        lambda slope: _walk(_DEAD_LOAD, 1.0, slope)[0, -1] - slope, 0.01, 1.5, xtol=1e-14
    )
    _, _, along, across = _walk(_DEAD_LOAD, 1.0, slope)[:, -1]
    cosine, sine = math.cos(slope), math.sin(slope)
    return np.array([along * cosine + across * sine, along * sine - across * cosine, 0.0])


if __name__ == "__main__":
    logging.disable(logging.WARNING)  # PyElastica warns of every thin rod's small inertia
    print(json.dumps(measure(float(sys.argv[1]))))
