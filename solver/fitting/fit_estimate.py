"""Convert a fit to an estimate with its values, or to a failure outcome."""

from dataclasses import replace
from typing import Any

import numpy as np

from solver.fitting.first_contact import nearest_linear_bend, no_contact
from solver.fitting.fit import FrameFit
from solver.fitting.minimise import DEFICIENT, STOPPED
from solver.fitting.problem import Problem
from solver.fitting.values import values_of
from solver.fitting.verdict import judged
from solver.instrument.arrays import Mask
from solver.instrument.estimate import Estimate, Outcome
from solver.instrument.measurement import Measurement

LEAST_POINTS = 8
# If less than this share of the beam is visible from the clamp on, chi2 may have no minimum.
SHORT_STRETCH = 0.25
# If more than this share of the points is rejected, the model is wrong.
MOST_REJECTED = 0.45
# The same for rejected points in runs of five and more: an occluder's edge affects fewer.
MOST_COHERENT = 1 / 3
# Above this share in runs, the other points must fit well: a beam with two contacts does not.
COHERENT = 0.1
MOST_CHI2_BESIDE_RUNS = 1.4
# Residuals twice as large as stated are not those of an exact beam with one contact.
MOST_CHI2_PER_DOF = 4.0


def refusal_of(
    measurement: Measurement, problem: Problem, fit: FrameFit | None, either_side: bool = False
) -> Estimate | None:
    """Return the failure outcome if no contact can be estimated from a frame; else None.

    Points that the fit rejects are ignored when the beam is tested for a bend. With `either_side`
    the beam may appear bent to either side of its rest position, as where its plane is steeper
    than the rays to the camera.
    """
    if problem.points < LEAST_POINTS:
        return Estimate(
            Outcome.NOT_IDENTIFIABLE, f"{problem.points} visible points, needed are {LEAST_POINTS}"
        )
    refusal = no_contact(nearest_linear_bend(measurement, _kept(measurement, fit)))
    if refusal is not None and not (either_side and refusal.outcome is Outcome.INVALID):
        return refusal
    if fit is None:
        return _stopped(problem, "no exact beam lies near the points")
    if fit.status == DEFICIENT:
        return Estimate(Outcome.NOT_IDENTIFIABLE, iterations=fit.iterations)
    off = ~fit.kept[problem.order]
    rejected = int(np.count_nonzero(off))
    if max(rejected / len(off) / MOST_REJECTED, _in_runs(off) / MOST_COHERENT) > 1:
        return Estimate(
            Outcome.INVALID,
            f"{rejected} of {problem.points} points lie off every exact beam with one contact",
            iterations=fit.iterations,
        )
    if fit.status == STOPPED:
        return replace(_stopped(problem), iterations=fit.iterations)
    return None


def _stopped(problem: Problem, message: str = "") -> Estimate:
    """Return the outcome of a fit without a minimum; a short stretch need not have one."""
    reach = float(np.hypot(*problem.arrays[0][:2]).max())
    if reach < SHORT_STRETCH:
        return Estimate(
            Outcome.NOT_IDENTIFIABLE, f"only the first {100 * reach:.0f} % of the beam are visible"
        )
    return Estimate(Outcome.NOT_CONVERGED, message)


def estimate_from_fit(
    measurement: Measurement,
    problem: Problem,
    fit: FrameFit,
    *,
    psi_known: bool,
    psi_fitted: bool = False,
    spread: Any = None,
) -> Estimate:
    """Convert a converged fit to an estimate.

    `spread` (8,) is an additional sigma of the fit's parameters, due to another minimum that fits
    almost as well.
    """
    arrays = problem.arrays
    moment = measurement.moment_y is not None and measurement.rig.sensors.moment_y is not None
    kept = int(np.count_nonzero(fit.kept))
    data = kept + 2 * len(arrays[3]) + int(moment)
    dof = max(data - 2 - int(psi_fitted), 1)

    def said(outcome: Outcome, message: str = "") -> Estimate:
        return Estimate(outcome, message, chi2=fit.chi2, dof=dof, iterations=fit.iterations)

    in_runs = _in_runs(~fit.kept[problem.order]) > COHERENT
    most = MOST_CHI2_BESIDE_RUNS if in_runs else MOST_CHI2_PER_DOF
    if fit.chi2 / dof > most:
        return said(
            Outcome.INVALID,
            f"the nearest exact beam with one contact leaves a chi2 of {fit.chi2 / dof:.1f} "
            f"per degree of freedom in {kept} of {problem.points} points",
        )
    if spread is not None:
        fit = replace(fit, covariance=fit.covariance + np.outer(spread, spread))
    values, covariance = values_of(measurement, fit, psi_known)
    rejected = problem.points - kept
    remarks = [f"{rejected} of {problem.points} points were rejected"] if rejected else []
    if measurement.moment_y is not None and not moment:
        remarks.append("the moment is left out, for the rig states no sigma of its sensor")
    return judged(
        measurement.rig,
        values,
        covariance,
        "; ".join(remarks),
        chi2=fit.chi2,
        dof=dof,
        iterations=fit.iterations,
    )


def _in_runs(off: Any) -> float:
    """Compute the share of points in the middle of five neighbours that are all rejected."""
    middle = off[2:-2] & off[1:-3] & off[3:-1] & off[:-4] & off[4:]
    return int(np.count_nonzero(middle)) / max(len(off), 1)


def _kept(measurement: Measurement, fit: FrameFit | None) -> Mask | None:
    """Return the mask (n,) of the first view's points that a fit keeps; None to use all points."""
    if fit is None or fit.status == STOPPED:
        return None
    kept = fit.kept[: len(measurement.points)]
    # If more points are rejected, the model is wrong, not the points.
    return None if kept.all() or kept.mean() < 1 - MOST_REJECTED else kept
