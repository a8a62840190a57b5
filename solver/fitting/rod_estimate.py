"""Estimate from one frame of a beam that is not uniform, or not known to be."""

import math
from dataclasses import replace
from typing import Final

import numpy as np

from solver.beam_models.exact import contact_at
from solver.beam_models.rod import GRIP, S_C, Q, contact_of, curve_of
from solver.fitting import frames, residuals
from solver.fitting.fit import FrameFit, start_of
from solver.fitting.fit_estimate import estimate_from_fit, refusal_of
from solver.fitting.problem import Problem, problem_of
from solver.fitting.rod_fit import fit_rod
from solver.fitting.rod_problem import RodProblem, rod_problem_of
from solver.fitting.rod_residuals import DX, DY, PSI, SOFTNESS, TILT, clamp_moment
from solver.fitting.thresholds import LIMITS
from solver.fitting.unknown_grip import curved_by_grip
from solver.instrument.arrays import Floats
from solver.instrument.estimate import Estimate, Outcome
from solver.instrument.measurement import Measurement

# Largest contact arc length of a start, over the beam's length. Chosen: a uniform beam may be
# nearest to a thin tip with a contact beyond it.
_MAX_START: Final = 0.95


def rod_estimate(measurement: Measurement) -> Estimate:
    """Estimate contact and force in the known plane, with the rig's stated or learned beam.

    What one image does not determine (section, friction, clamp) has the prior that the rig states,
    and widens the covariance accordingly.
    """
    bowed = with_bow(measurement)
    problem = problem_of(bowed, with_tips=False)
    rod = rod_problem_of(bowed, problem)
    fit = fit_frame(problem, rod) if problem.points >= LIMITS.min_points else None
    refusal = refusal_of(measurement, problem, fit)
    if refusal is not None or fit is None:
        return refusal or Estimate(Outcome.NOT_CONVERGED)
    values, covariance = rod_values(measurement, rod, fit)
    return estimate_from_fit(measurement, problem, fit, values, covariance)


def with_bow(measurement: Measurement) -> Measurement:
    """Return the measurement with the bow that was removed from its points."""
    if measurement.rest_bow is None:
        return measurement
    view = measurement.view
    points = view.points + measurement.rest_bow.removed
    return replace(measurement, view=replace(view, points=points))


def fit_frame(problem: Problem, rod: RodProblem) -> FrameFit | None:
    """Fit a frame from the start of a uniform beam; None if no beam is near the points.

    The fit's `kept` (n,) is in the order of the measurement's points.
    """
    start = uniform_start(problem, rod)
    fit = None if start is None else fit_rod(rod, start)
    if fit is None:
        return None
    kept = np.empty_like(fit.kept)
    kept[problem.order] = fit.kept
    return replace(fit, kept=kept)


def uniform_start(problem: Problem, rod: RodProblem) -> Floats | None:
    """Return the parameters (p,) with load, place and clamp of a uniform beam near the points.

    Return None if there is none.
    """
    size = rod.shape_size
    uniform = start_of(problem, float(rod.mean[size + PSI]))
    if uniform is None:
        return None
    start = rod.mean.copy()
    start[Q] = uniform[residuals.Q]
    _, _, _, arc = contact_at(uniform[residuals.Q], uniform[residuals.LEVER])
    start[S_C] = min(arc[0], _MAX_START)
    start[size + DX : size + TILT + 1] = uniform[residuals.DX : residuals.TILT + 1]
    return start


def rod_values(
    measurement: Measurement, rod: RodProblem, fit: FrameFit
) -> tuple[dict[str, float], Floats]:
    """Compute the values of a fit by name, and their joint covariance, as `values_of`."""
    rig, size, count = measurement.rig, rod.shape_size, len(fit.p)
    beam, length = rig.beam, rig.beam.length
    curve = curve_of(fit.p[:size], rod.widths, rod.radius)
    quantities, by_shape = contact_of(curve, fit.p[:size])
    moment, by_moment = clamp_moment(curve, fit.p[:size])
    # Variables: the fit's parameters, relative errors of all lengths and of EI, the motor angle.
    scale, rigidity, angle = count, count + 1, count + 2
    contact, jacobian = np.zeros(frames.CONTACT), np.zeros((frames.CONTACT, count + 3))
    force_unit = beam.flexural_rigidity / length**2
    rows = (frames.FORCE, frames.THETA, frames.X_C, frames.Y_C, frames.S_C, frames.LEAN)
    units = np.array([force_unit, 1.0, length, length, length, 1.0])
    contact[list(rows)] = quantities * units
    jacobian[list(rows), :size] = by_shape * units[:, None]
    for row in (frames.X_C, frames.Y_C, frames.S_C):
        jacobian[row, scale] = contact[row]
    jacobian[frames.FORCE, scale] = -2 * contact[frames.FORCE]
    jacobian[frames.FORCE, rigidity] = contact[frames.FORCE]
    for row, column, unit in (
        (frames.PSI, PSI, 1.0),
        (frames.DX, DX, length),
        (frames.DY, DY, length),
        (frames.TILT, TILT, 1.0),
    ):
        contact[row], jacobian[row, size + column] = fit.p[size + column] * unit, unit
    # The clamp turns under its moment.
    softness = fit.p[size + SOFTNESS]
    contact[frames.TILT] += softness * moment
    jacobian[frames.TILT, :size] = softness * by_moment
    jacobian[frames.TILT, size + SOFTNESS] = moment
    contact[frames.ANGLE], jacobian[frames.ANGLE, angle] = measurement.motor_angle or 0.0, 1.0
    covariance = np.zeros((count + 3, count + 3))
    covariance[:count, :count] = fit.covariance
    covariance[scale, scale] = measurement.scale_sigma**2
    if measurement.rest_bow is not None:  # which this beam has in its shape
        covariance[scale, scale] -= measurement.rest_bow.scale_sigma**2
    tolerance = rig.tolerances.flexural_rigidity / beam.flexural_rigidity
    covariance[rigidity, rigidity] = math.hypot(tolerance, rig.shape.rigidity_sigma) ** 2
    if measurement.motor_angle is not None:
        covariance[angle, angle] = rig.tolerances.encoder**2
    values, by_contact, pose_covariance = frames.in_all_frames(
        measurement, contact, clamp_fitted=True
    )
    total = by_contact @ jacobian
    result = np.asarray(total @ covariance @ total.T + pose_covariance)
    force, grip = list(values).index("force_n"), float(fit.p[GRIP])
    grip_sigma = math.sqrt(fit.covariance[GRIP, GRIP])
    result[force, force] += curved_by_grip(values["force_n"], grip, grip_sigma)
    return values, result
