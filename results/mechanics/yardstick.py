"""Yardstick of speed: PyElastica's simulation of a cantilever until it is at rest."""

import importlib
import math
from collections.abc import Callable
from time import perf_counter
from types import ModuleType
from typing import Any, Final

import numpy as np

from results.mechanics.reference import BEAM, YOUNGS_MODULUS, dead_load_tip
from vbaa_bench.mechanics.rod import POISSON

DENSITY: Final = 7850.0
# The dead load on the tip, in EI / L^2: it moves the tip by a fifth of L.
_DEAD_LOAD = 0.625
_ELEMENTS = 50
# Steps between two tests for rest. The rod is at rest when no node would move farther than this
# fraction of L while the phase of the slowest mode changes by a radian.
_STEPS_PER_TEST = 1000
_MAX_REST_SPEED = 1e-6


def yardstick(seconds: float) -> dict[str, Any] | None:
    """Simulate a cantilever under a dead load by PyElastica until it is at rest, and time it.

    The simulation stops at rest, or after `seconds` of wall time. Returns None if PyElastica is
    not installed.
    """
    try:
        elastica = importlib.import_module("elastica")
    except ModuleNotFoundError:
        return None
    start = perf_counter()
    rod, advance_once, slowest_rate = _cantilever(elastica)
    advance_once()
    cold = perf_counter() - start
    start, elapsed, at_rest, steps = perf_counter(), 0.0, False, 1
    while not at_rest and elapsed < seconds:
        for _ in range(_STEPS_PER_TEST):
            advance_once()
        steps += _STEPS_PER_TEST
        speed = float(np.linalg.norm(rod.velocity_collection, axis=0).max())
        at_rest, elapsed = (
            speed < _MAX_REST_SPEED * slowest_rate * BEAM.length,
            perf_counter() - start,
        )
    error = np.linalg.norm(rod.position_collection[:, -1] / BEAM.length - dead_load_tip(_DEAD_LOAD))
    return {
        "states_per_s": 1 / elapsed,
        "tip_error_pct_L": 100 * float(error),
        "at_rest": at_rest,
        "steps": steps,
        "elements": _ELEMENTS,
        "cold_start_s": cold,
    }


def _cantilever(elastica: ModuleType) -> tuple[Any, Callable[[], None], float]:
    """Build PyElastica's rod, a function that advances it, and the slowest mode's rate [rad/s].

    PyElastica fixes the first element, so half an element is added there. The rotary inertia is
    raised until the sections' spin, whose stable step would otherwise be the shortest by far, is
    no faster than sound along an element; it does not affect the beam at rest.
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
    sound_rate = 2 * math.sqrt(YOUNGS_MODULUS / DENSITY) / element
    inertia = rod.mass_second_moment_of_inertia[0, 0, 1]
    factor = max(rod.shear_matrix[0, 0, 1] * element / inertia / sound_rate**2, 1.0)
    rod.mass_second_moment_of_inertia *= factor
    rod.inv_mass_second_moment_of_inertia /= factor
    linear_density = DENSITY * math.pi * BEAM.radius**2
    slowest_rate = 1.8751**2 * math.sqrt(BEAM.flexural_rigidity / linear_density) / BEAM.length**2
    time_step = 0.8 / sound_rate
    mixins = ("BaseSystemCollection", "Constraints", "Forcing", "Damping")
    world: Any = type("World", tuple(getattr(elastica, mixin) for mixin in mixins), {})()
    world.append(rod)
    clamped = {"constrained_position_idx": (0,), "constrained_director_idx": (0,)}
    world.constrain(rod).using(elastica.OneEndFixedBC, **clamped)
    force = np.array([0.0, _DEAD_LOAD * BEAM.flexural_rigidity / BEAM.length**2, 0.0])
    load = {"start_force": np.zeros(3), "end_force": force, "ramp_up_time": time_step}
    world.add_forcing_to(rod).using(elastica.EndpointForces, **load)
    # The slowest mode comes to rest soonest when it is damped critically.
    damping = {"uniform_damping_constant": 2 * slowest_rate, "time_step": time_step}
    world.dampen(rod).using(elastica.AnalyticalLinearDamper, **damping)
    world.finalize()
    stepper, now = elastica.PositionVerlet(), 0.0

    def advance_once() -> None:
        nonlocal now
        now = stepper.step(world, now, time_step)

    return rod, advance_once, slowest_rate
