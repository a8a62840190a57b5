"""Convert a fit to an estimate with its values, or to a failure outcome.

A contact may also be an interval, one at the tip, or none.
"""

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from solver.core.least_squares import DEFICIENT, STOPPED
from solver.core.thresholds import THRESHOLDS
from solver.fitting.first_contact import nearest_linear_bend, no_contact
from solver.instrument.arrays import Floats, Mask
from solver.instrument.estimate import Assumption, Estimate, Outcome
from solver.instrument.measurement import Measurement
from solver.instrument.rig import Rig
from solver.uniform.fit import FrameFit
from solver.uniform.problem import Problem


def refusal_of(
    measurement: Measurement, problem: Problem, fit: FrameFit | None, either_side: bool = False
) -> Estimate | None:
    """Return the failure outcome if no contact can be estimated from a frame; else None.

    Points that the fit rejects are ignored when the beam is tested for a bend. With `either_side`
    the beam may appear bent to either side of its rest position, as where its plane is steeper
    than the rays to the camera.
    """
    if problem.points < THRESHOLDS.min_points:
        return Estimate(
            Outcome.NOT_IDENTIFIABLE,
            f"{problem.points} visible points, needed are {THRESHOLDS.min_points}",
        )
    refusal = no_contact(nearest_linear_bend(measurement, _inliers(measurement, fit)))
    if refusal is not None and not (either_side and refusal.outcome is Outcome.INVALID):
        return refusal
    if fit is None:
        return _failed(
            problem, "no start: the points do not resemble a cantilever with one contact"
        )
    if fit.status == DEFICIENT:
        return Estimate(Outcome.NOT_IDENTIFIABLE, iterations=fit.iterations)
    outliers = ~fit.kept[problem.order]
    rejected = int(np.count_nonzero(outliers))
    if (
        max(
            rejected / len(outliers) / THRESHOLDS.max_rejected,
            _in_runs(outliers) / THRESHOLDS.max_in_runs,
        )
        > 1
    ):
        return Estimate(
            Outcome.INVALID,
            f"{rejected} of {problem.points} points do not fit an exact beam with one contact",
            iterations=fit.iterations,
        )
    if fit.status == STOPPED:
        return replace(_failed(problem), iterations=fit.iterations)
    return None


def _failed(problem: Problem, message: str = "") -> Estimate:
    """Return the outcome of a fit without a minimum; a short stretch need not have one."""
    visible = float(np.hypot(*problem.arrays.points[:2]).max())
    if visible < THRESHOLDS.short_stretch:
        return Estimate(
            Outcome.NOT_IDENTIFIABLE, f"only the first {100 * visible:.0f} % of the beam is visible"
        )
    return Estimate(Outcome.NOT_CONVERGED, message)


def estimate_from_fit(
    measurement: Measurement,
    problem: Problem,
    fit: FrameFit,
    values: Mapping[str, float],
    covariance: Floats,
    *,
    psi_fitted: bool = False,
    moment_fitted: bool = True,
) -> Estimate:
    """Convert a converged fit with its values, and their covariance, to an estimate.

    `moment_fitted` is whether the fit uses the reading of a moment sensor, if there is one.
    """
    read = measurement.moment_y is not None
    known = measurement.rig.sensors.moment_y is not None
    has_moment = read and known and moment_fitted
    count = int(np.count_nonzero(fit.kept))
    measurements = count + 2 * len(problem.arrays.tips) + int(has_moment)
    dof = max(measurements - 2 - int(psi_fitted), 1)

    def failure(outcome: Outcome, message: str = "") -> Estimate:
        return Estimate(outcome, message, chi2=fit.chi2, dof=dof, iterations=fit.iterations)

    in_runs = _in_runs(~fit.kept[problem.order]) > THRESHOLDS.some_in_runs
    max_chi2 = THRESHOLDS.max_chi2_beside_runs if in_runs else THRESHOLDS.max_chi2
    if fit.chi2 / dof > max_chi2:
        return failure(
            Outcome.INVALID,
            f"the nearest exact beam with one contact leaves a chi2 of {fit.chi2 / dof:.1f} "
            f"per degree of freedom in {count} of {problem.points} points",
        )
    rejected = problem.points - count
    remarks = [f"{rejected} of {problem.points} points were rejected"] if rejected else []
    if read and not known:
        remarks.append("moment ignored: the rig has no sigma for its moment sensor")
    elif read and not has_moment and measurement.rig.known_psi:  # in plane C it would say nothing
        remarks.append("moment ignored: the beam's own shape is fitted, as rig.json states it")
    return classified_estimate(
        measurement.rig,
        values,
        covariance,
        "; ".join(remarks),
        chi2=fit.chi2,
        dof=dof,
        iterations=fit.iterations,
    )


def _in_runs(outliers: Any) -> float:
    """Compute the fraction of points in the middle of five neighbours that are all rejected."""
    if not outliers.any():
        return 0.0
    middle = outliers[2:-2] & outliers[1:-3] & outliers[3:-1] & outliers[:-4] & outliers[4:]
    return int(np.count_nonzero(middle)) / max(len(outliers), 1)


def _inliers(measurement: Measurement, fit: FrameFit | None) -> Mask | None:
    """Return the mask (n,) of the first view's inliers; None to use all points."""
    if fit is None or fit.status == STOPPED:
        return None
    inliers = fit.kept[: len(measurement.points)]
    # If more points are rejected, the model is wrong, not the points.
    return None if inliers.all() or inliers.mean() < 1 - THRESHOLDS.max_rejected else inliers


def classified_estimate(
    rig: Rig,
    values: Mapping[str, float],
    covariance: Floats,
    message: str = "",
    *,
    chi2: float | None = None,
    dof: int | None = None,
    iterations: int | None = None,
) -> Estimate:
    """Return the estimate of a contact, or a failure outcome if the rig's beam cannot have it.

    The contact arc length, or the contact distance if a method does not estimate it, is compared
    with the beam's length and its tolerance.
    """

    def sigma(name: str) -> float:
        index = list(values).index(name)
        return math.sqrt(max(float(covariance[index, index]), 0.0))

    position = "s_c_m" if "s_c_m" in values else "x_c_m"
    outcome, reason = verdict(
        rig, values["x_c_m"], sigma("x_c_m"), values[position], sigma(position)
    )
    has_values = outcome.has_values
    beyond_tip = outcome is Outcome.INVALID
    return Estimate(
        outcome,
        message if has_values else reason,
        values=values if has_values else {},
        covariance=(covariance + covariance.T) / 2 if has_values else None,
        chi2=chi2,
        dof=dof,
        iterations=iterations,
        assumption=Assumption.LENGTH if beyond_tip else None,
    )


def verdict(
    rig: Rig, x_c: float, x_sigma: float, s_c: float, s_sigma: float
) -> tuple[Outcome, str]:
    """Return the outcome of a contact at distance x_c [m], arc length s_c [m], and the reason."""
    length = rig.free_length
    s_sigma = math.hypot(s_sigma, rig.tolerances.beam_length)
    if s_c > length + THRESHOLDS.beyond_tip_sigmas * s_sigma:
        return (
            Outcome.INVALID,
            f"the contact is at {s_c:.4g} m, beyond the tip at {length:.4g} m",
        )
    if x_sigma > length:
        return Outcome.NOT_IDENTIFIABLE, "the contact can be anywhere on the beam"
    if x_sigma > THRESHOLDS.weak_sigma * length:
        return Outcome.WEAK_CONTACT, ""
    if x_c < THRESHOLDS.x_c_sigmas * x_sigma:
        return Outcome.NOT_IDENTIFIABLE, "the contact is within four sigma of the clamp"
    if s_c > length - 2 * s_sigma:
        return Outcome.TIP_CONTACT, ""
    return Outcome.CONTACT, ""


def single_frame(estimate: Estimate, reason: str) -> Estimate:
    """Return a single frame's estimate, with the reason why it is not that of its push."""
    message = "; ".join(
        part for part in (f"from this frame alone: {reason}", estimate.message) if part
    )
    return replace(estimate, message=message)
