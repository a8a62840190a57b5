"""Measure each model's speed in solving for equilibrium on one core, and its error."""

import json
import logging
import math
import os
import subprocess
import sys
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from statistics import median
from time import perf_counter
from typing import Any, Final

import numpy as np

from results.mechanics.reference import BEAM, Push, reference
from results.mechanics.yardstick import DENSITY, yardstick
from solver.instrument.arrays import Floats
from solver.instrument.transforms import rigid
from vbaa_bench.mechanics import planar, pushing
from vbaa_bench.mechanics.contact import Obstacle
from vbaa_bench.mechanics.rod import STEPS, Rod, advance
from vbaa_bench.mechanics.rod_contact import Motor, Step
from vbaa_bench.mechanics.state import State
from vbaa_bench.mechanics.surfaces import upright

NOT_INSTALLED: Final = "not installed: pip install 'vbaa-bench[yardstick]'"

# Number of times each set of states is solved; the median time counts.
_REPEATS = 3
_ROOT: Final = Path(__file__).parents[2]
_ONE_THREAD = ("OMP", "OPENBLAS", "MKL", "NUMBA")

Record = dict[str, Any]


def measure_apart(yardstick_seconds: float) -> Record:
    """Run `measure` in a fresh process whose numerical libraries use one thread."""
    environment = os.environ | {f"{name}_NUM_THREADS": "1" for name in _ONE_THREAD}
    command = [sys.executable, "-m", "results.mechanics.measure", str(yardstick_seconds)]
    completed = subprocess.run(
        command, cwd=_ROOT, env=environment, stdout=subprocess.PIPE, text=True, check=True
    )
    record: Record = json.loads(completed.stdout)
    return record


def measure(
    yardstick_seconds: float, *, flat: int = 3000, compared: int = 20, spatial: int = 60
) -> Record:
    """Measure states per second, and the error, of every model.

    `flat` pushes are solved by the planar model, `compared` of them also by scipy's integrator;
    `spatial` pushes are solved by the rod in space.
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
    baseline = record["yardstick"]
    for model in ("planar", "space_plain", "space_all_effects"):
        speed = record[model]["states_per_s"]
        record[model]["times_yardstick"] = baseline and speed / baseline["states_per_s"]
    return record


def rows(record: Record) -> list[tuple[str, str, str, str, str]]:
    """Format rows: model, states per second, ratio to the yardstick, worst error, remark."""
    flat, baseline = record["planar"], record["yardstick"]
    bare, cold = flat["states_per_s_without_centreline"], flat["cold_start_s"]
    remarks = {
        "planar": f"against DOP853; {_three_digits(bare)}/s without centreline; "
        f"first state {cold:.2g} s",
        "space_plain": "the same pushes in space; against planar",
        "space_all_effects": "weight, bow, taper, stretch, ellipse, tilt, spring, friction; "
        "against a finer mesh",
    }
    at_rest = baseline is None or baseline["at_rest"]
    table = []
    for model, remark in remarks.items():
        result = record[model]
        ratio = _three_digits(result["times_yardstick"]) if baseline else "–"
        error = f"{max(result['worst_relative_error'], result['worst_residual']):.1e}"
        name, speed = model.replace("_", " "), _three_digits(result["states_per_s"])
        table.append((name, speed, ratio if at_rest else f"> {ratio}", error, remark))
    if baseline is None:
        return [*table, ("yardstick", "–", "–", "–", NOT_INSTALLED)]
    speed, error = (
        _three_digits(baseline["states_per_s"]),
        f"{baseline['tip_error_pct_L'] / 100:.1e}",
    )
    state = "at rest" if at_rest else "not yet at rest"
    remark = (
        f"PyElastica, dead load, {state} after {1 / baseline['states_per_s']:.3g} s; tip over L"
    )
    return [*table, ("yardstick", speed if at_rest else f"< {speed}", "1", error, remark)]


def _three_digits(number: float) -> str:
    return f"{float(f'{number:.3g}'):,g}"


def _planar(pushes: Sequence[Push], compared: int) -> Record:
    solve = partial(_planar_state, intervals=480)
    cold, speed, states = _timed(solve, pushes)
    _, bare, _ = _timed(partial(_planar_state, intervals=3), pushes)
    return {
        "states_per_s": speed,
        "states_per_s_without_centreline": bare,
        "worst_relative_error": max(
            _difference(state, *reference(push, state))
            for push, state in zip(pushes[:compared], states[:compared], strict=True)
        ),
        "worst_residual": max(state.residual for state in states),
        "states": len(states),
        "compared": min(compared, len(states)),
        "cold_start_s": cold,
    }


def _space_plain(pushes: Sequence[Push]) -> Record:
    rod = Rod(BEAM)

    def solve(push: Push) -> State:
        distance, deflection = push
        edge = Obstacle(upright(), rigid([0.0, 0.0, 0.0], [distance, -BEAM.radius, 0.0]))
        return pushing.push(rod, Motor(), [edge], distance, [Step(deflection=deflection)])[0]

    cold, speed, states = _timed(solve, pushes)
    references = [_planar_state(push, 480) for push in pushes]
    return {
        "states_per_s": speed,
        "worst_relative_error": max(
            _difference(
                state,
                reference_state.contact.force,
                reference_state.contact.s,
                reference_state.centreline[:, 1:],
            )
            for state, reference_state in zip(states, references, strict=True)
        ),
        "worst_residual": max(state.residual for state in states),
        "states": len(states),
        "cold_start_s": cold,
    }


def _space_all_effects(pushes: Sequence[Push]) -> Record:
    weight = DENSITY * math.pi * BEAM.radius**2 * 9.81
    rod = Rod(
        BEAM,
        aspect_ratio=1.2,
        section_angle=0.3,
        tip_ratio=0.8,
        weight=(0.0, 0.0, -weight),
        bow=(0.2, 0.1),
        extensible=True,
    )
    rest_line, tilt = pushing.rest(rod).centreline, math.radians(30)
    normal = np.array([0.0, math.cos(tilt), math.sin(tilt)])

    def solve(push: Push) -> State:
        s, *point = rest_line[np.searchsorted(rest_line[:, 0], push[0])]
        pose = rigid([tilt, 0.0, 0.0], np.array(point) - rod.reach(float(s), tilt) * normal)
        edge = Obstacle(upright(), pose, compliance=1e-3, friction=0.1)
        return pushing.push(rod, Motor(), [edge], float(s), [Step(deflection=push[1])])[0]

    _, speed, states = _timed(solve, pushes)
    return {
        "states_per_s": speed,
        "worst_relative_error": max(_refinement_error(rod, state) for state in states),
        "worst_residual": max(state.residual for state in states),
        "states": len(states),
    }


def _timed(
    solve: Callable[[Push], State], pushes: Sequence[Push]
) -> tuple[float, float, list[State]]:
    """Time all states.

    Returns the seconds of the first state, which loads or compiles code; the states per second;
    and the states.
    """
    start = perf_counter()
    solve(pushes[0])
    cold = perf_counter() - start
    times = []
    for _ in range(_REPEATS):
        start = perf_counter()
        states = [solve(push) for push in pushes]
        times.append(perf_counter() - start)
    return cold, len(pushes) / median(times), states


def _planar_state(push: Push, intervals: int) -> State:
    return planar.push(BEAM, push[0], deflection=push[1], intervals=intervals)


def _difference(state: State, force: Floats, s_c: float, points: Floats) -> float:
    """Compute the largest relative difference of a state from reference values.

    They are a contact force (3,) [N], its arc length [m], and a centreline (n, 3) [m]; the last
    difference is relative to the tip's deflection.
    """
    contact = state.contact
    position_error = np.linalg.norm(state.centreline[:, 1:] - points, axis=1).max() / state.tip[1]
    force_error = np.linalg.norm(contact.force - force) / np.linalg.norm(force)
    return float(max(position_error, force_error, abs(contact.s / s_c - 1)))


def _refinement_error(rod: Rod, state: State) -> float:
    """Compute the change of a state on a mesh eight times as fine, under its own forces.

    Positions are relative to the tip's deflection, the residual moment at the tip to the clamp's.
    """
    length, unit, contact = rod.beam.length, rod.force_unit, state.contact
    rotation = Motor().clamp_from_world(state.pushing_angle, (0.0, 0.0, 0.0))[:3, :3]
    properties, s_c = rod.properties(rotation), contact.s / length
    clamp, steps = rod.clamp(-state.base_moment / (unit * length)), 8 * STEPS
    at_contact = advance(clamp, 0.0, s_c, steps, contact.force / unit, properties)
    shift = at_contact[:3] * length - contact.point
    at_contact[9:] -= np.cross(contact.lever, contact.force) / (unit * length)
    tip = advance(at_contact, s_c, 1.0, steps, np.zeros(3), properties)
    distance = max(np.linalg.norm(shift), np.linalg.norm(tip[:3] * length - state.tip))
    residual_moment = np.linalg.norm(tip[9:]) / np.linalg.norm(clamp[9:])
    return float(max(distance / state.tip[1], residual_moment))


if __name__ == "__main__":
    logging.disable(logging.WARNING)  # PyElastica warns about every thin rod's small inertia
    print(json.dumps(measure(float(sys.argv[1]))))
