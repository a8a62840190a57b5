"""Measure each method's noise amplification, rounding sensitivity and condition number.

The beam of the paper's rig is pushed by the world's mechanics. The methods get its columns as
points with 0.05 px of noise, without images. The clamp is known to a nanometre, so that the
numbers depend on the points only. For every contact distance and deflection of a grid:

- Noise amplification: the standard deviation of x_c, in % of L, and of the force, in % of itself,
  over that of the points, in pixels, with independent errors of all columns. It is measured by
  perturbation, not taken from a method's covariance: stretches of neighbouring columns are moved
  by one sigma, one after another. If the derivative is smooth along the beam, a stretch of m
  columns changes the estimate m times as much as one column. The sum of squares over all columns
  is then the sum over all stretches of their squares over m. An amplification of 0.5 % means that
  0.05 px of noise causes 0.025 % of L.
- Condition number: of the normal equations of the methods that have them, in the contact distance,
  the force and the other fitted unknowns (the inclination, the compliance, the onset), each in
  units of its own error, so that units have no effect. Solving the equations loses as many decimal
  digits to rounding as the condition number has. Its square root is the ratio of the errors of the
  worst and the best known combination of the unknowns.
- Rounding: the largest change of x_c, over L, if every coordinate moves by one unit in the last
  place, up or down at random. Methods that average pairs may gain or lose a pair by this.

Each push has two frames before the evaluated one, and sensors of 1 %; methods that do not use them
give the same estimates without them. `force_sensor` does not use points at all. Linear methods are
evaluated with their bias, which noise does not show: amplification measures scatter, not bias.
"""

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Final

import numpy as np

from solver.instrument.arrays import Floats
from solver.instrument.beam import Beam, circular_rigidity
from solver.instrument.board import Chessboard
from solver.instrument.estimate import Estimate
from solver.instrument.measurement import Measurement, View
from solver.instrument.rig import Gravity, Rig, Sensors, Tolerances
from solver.methods import Method
from solver.tracker import run_method
from vbaa_bench.mechanics.planar import push
from vbaa_bench.mechanics.state import State

Record = dict[str, Any]

# The beam of the paper, section VI-A.
BEAM: Final = Beam(0.24, 0.8e-3, circular_rigidity(200e9, 0.8e-3))
CONTACTS: Final = (0.1, 0.3, 0.5, 0.7, 0.9)  # x_c / L before the push
DEFLECTIONS: Final = (0.05, 0.2)
PIXEL: Final = 0.51e-3  # on plane C [m]
SIGMA_PX: Final = 0.05
# From above the beam's middle, perspective would hardly constrain the plane of three points.
VIEWPOINT: Final = np.array([-0.12, 0.0, 0.36, 1.0])
STRETCHES: Final = 32
# Pushing angles of the frames before the last, over that of the last.
EARLIER_FRACTIONS: Final = (0.5, 0.75)
ONSET: Final = 0.2  # motor angle of first contact [rad]
FITTED: Final = ("x_c_m", "force_n", "psi_rad", "compliance_m_per_n", "onset_angle_rad")


def measure(methods: Mapping[str, Method], contacts: tuple[float, ...] = CONTACTS) -> Record:
    """Measure methods on every push of the grid, as numbers that JSON can hold."""
    pushes = {
        (contact, deflection): simulate_push(BEAM, contact * BEAM.length, deflection)
        for contact in contacts
        for deflection in DEFLECTIONS
    }
    return {
        "noise_px": SIGMA_PX,
        "methods": {
            name: [
                {"contact": contact, "deflection": deflection, **assess_method(method, measurement)}
                for (contact, deflection), measurement in pushes.items()
            ]
            for name, method in methods.items()
        },
    }


def simulate_push(beam: Beam, distance: float, deflection: float) -> Measurement:
    """Simulate noisy columns of a push in plane C against a sharp edge at `distance` [m].

    `deflection` is y_tip / L. Frames of smaller pushing angles precede the last frame, which is
    evaluated.
    """
    last = push(beam, distance, deflection=deflection, intervals=4000)
    before = [
        push(beam, distance, pushing_angle=fraction * last.pushing_angle, intervals=4000)
        for fraction in EARLIER_FRACTIONS
    ]
    *frames, final = [_frame(beam, state, last) for state in (*before, last)]
    return replace(final, earlier=tuple(frames))


def assess_method(method: Method, measurement: Measurement) -> Record:
    """Measure outcome, amplification, condition and rounding of one method on one push.

    An undefined number is None.
    """
    plain = run_method(method, measurement)
    record: Record = {
        "outcome": str(plain.outcome),
        "x_c_pct_L_per_px": None,
        "force_pct_per_px": None,
        "condition": None if plain.chi2 is None else condition(plain),
        "rounding": None,
    }
    if not plain.values:
        return record
    gains = amplification(method, measurement, plain)
    if gains is not None:
        record["x_c_pct_L_per_px"] = 100 * gains[0] * PIXEL / measurement.rig.beam.length
        record["force_pct_per_px"] = 100 * gains[1] * PIXEL / plain.values["force_n"]
    return record | {"rounding": rounding(method, measurement, plain)}


def amplification(
    method: Method, measurement: Measurement, plain: Estimate
) -> tuple[float, float] | None:
    """Compute standard deviations of x_c and force over that of the points, [m/m] and [N/m].

    Returns None if the method gives no estimate when points move by one sigma.
    """
    points, sigmas = measurement.points, measurement.sigma_vectors
    squares = np.zeros(2)
    for stretch in np.array_split(np.argsort(points[:, 0]), STRETCHES):
        moved = points.copy()
        moved[stretch] += sigmas[stretch]
        estimate = run_method(method, _with_points(measurement, moved))
        if not estimate.values:
            return None
        change = [estimate.values[name] - plain.values[name] for name in ("x_c_m", "force_n")]
        squares += np.square(change) / len(stretch)
    x_c, force = np.sqrt(squares) / (SIGMA_PX * PIXEL)
    return float(x_c), float(force)


def condition(estimate: Estimate) -> float | None:
    """Compute the condition number of the scaled normal equations from an estimate's covariance."""
    names = list(estimate.values)
    fitted = [names.index(name) for name in FITTED if name in names]
    if estimate.covariance is None or not fitted:
        return None
    covariance = estimate.covariance[np.ix_(fitted, fitted)]
    free = np.diag(covariance) > 0
    normal: Floats = np.linalg.inv(_scaled(covariance[np.ix_(free, free)])).astype(np.float64)
    return float(np.linalg.cond(_scaled(normal)))


def rounding(method: Method, measurement: Measurement, plain: Estimate) -> float | None:
    """Compute the largest change of x_c / L under perturbations of one unit in the last place."""
    random = np.random.default_rng(0)
    largest = 0.0
    for _ in range(3):
        directions = np.where(random.random(measurement.points.shape) < 0.5, -np.inf, np.inf)
        estimate = run_method(
            method, _with_points(measurement, np.nextafter(measurement.points, directions))
        )
        if not estimate.values:
            return None
        largest = max(largest, abs(estimate.values["x_c_m"] - plain.values["x_c_m"]))
    return largest / measurement.rig.beam.length


def rows(record: Record) -> list[tuple[str, ...]]:
    """Format a row for each method and deflection.

    A row has both, the amplification of x_c and of the force at every contact distance, the range
    of the condition number, and the worst rounding.
    """
    table: list[tuple[str, ...]] = []
    for name, cases in record["methods"].items():
        for deflection in DEFLECTIONS:
            selected = [case for case in cases if case["deflection"] == deflection]
            conditions = [case["condition"] for case in selected if case["condition"] is not None]
            roundings = [case["rounding"] for case in selected if case["rounding"] is not None]
            table.append(
                (
                    name,
                    f"{100 * deflection:.0f} %",
                    "  ".join(_short(case["x_c_pct_L_per_px"]) for case in selected),
                    "  ".join(_short(case["force_pct_per_px"]) for case in selected),
                    _range(conditions),
                    f"{max(roundings):.0e}" if roundings else "–",
                )
            )
    return table


def _frame(beam: Beam, state: State, last: State) -> Measurement:
    line = state.centreline
    x = np.arange(line[0, 1] + 6 * PIXEL, line[-1, 1], PIXEL)
    noise = SIGMA_PX * PIXEL * np.random.default_rng(0).standard_normal(len(x))
    points = np.column_stack([x, np.interp(x, line[:, 1], line[:, 2]) + noise])
    tolerances = Tolerances(
        **dict.fromkeys(Tolerances.__dataclass_fields__, 0.0) | {"encoder": 1e-4}
    )
    force, moment = state.base_force, state.base_moment
    # One per cent of the last frame's load.
    moment_sigma = 0.01 * float(np.linalg.norm(last.base_moment))
    sensors = Sensors(
        moment_y=moment_sigma,
        base_force=0.01 * float(np.linalg.norm(last.base_force)),
        base_moment=moment_sigma,
    )
    motor_angle = ONSET - state.pushing_angle
    # The object's force may as well be that of a hung weight.
    gravity = Gravity(math.atan2(-force[1], -force[0]) + motor_angle)
    return Measurement(
        view=View(points, np.tile([0.0, SIGMA_PX * PIXEL], (len(x), 1)), VIEWPOINT),
        base_covariance=1e-18 * np.eye(3),
        scale_sigma=0.0,
        motor_angle=motor_angle,
        rig=Rig(
            beam=beam,
            base_position=np.zeros(3),
            board=Chessboard(12, 9, 0.018),
            antenna_from_board=np.eye(4),
            deflects_towards=1,
            tolerances=tolerances,
            sensors=sensors,
            gravity=gravity,
        ),
        moment_y=0.0,
        base_force=(float(force[0]), float(force[1]), float(force[2])),
        base_moment=(float(moment[0]), float(moment[1]), float(moment[2])),
    )


def _with_points(measurement: Measurement, points: Floats) -> Measurement:
    return replace(measurement, view=replace(measurement.view, points=points))


def _scaled(matrix: Floats) -> Floats:
    scale = np.sqrt(np.diag(matrix))
    return np.asarray(matrix / np.outer(scale, scale))


def _short(number: float | None) -> str:
    return "–" if number is None else f"{number:.2g}" if number < 100 else f"{number:.0f}"


def _range(numbers: list[float]) -> str:
    if not numbers:
        return "–"
    low, high = (f"{float(f'{number:.1g}'):,g}" for number in (min(numbers), max(numbers)))
    return low if low == high else f"{low} to {high}"
