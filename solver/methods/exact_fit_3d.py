"""Least squares with the exact beam where the deformation plane is unknown too.

Contact, force and the inclination psi are estimated together, from one image (the paper's section
V-B), or with a moment sensor (V-C), or the image of the tip, whichever the measurement contains. To
first order an image shows only the deflection times cos(psi) - (y_v / z_v) sin(psi); psi is
determined by second-order perspective, or by the position in the image of the tip of a beam of
known length. chi2 may have several minima over psi: all are searched for.

Where the rig states that the beam may be tapered or out of round, or objects rough, or where the
beam was learned, or where it has a bow that matters, it is the beam of `frame_estimate`.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from solver.core.least_squares import CONVERGED
from solver.core.thresholds import THRESHOLDS
from solver.fitting.first_contact import nearest_linear_bend, no_contact
from solver.fitting.frame_estimate import with_bow
from solver.fitting.frame_problem import FrameProblem, frame_problem_of
from solver.fitting.frame_values import frame_values
from solver.fitting.stated_beam import prior_conflict
from solver.fitting.uniform_estimate import uniform_values
from solver.fitting.unknown_plane import fits_in_space, problem_in_plane
from solver.fitting.verdict import estimate_from_fit, refusal_of
from solver.instrument.arrays import Floats
from solver.instrument.estimate import Estimate, Outcome
from solver.instrument.measurement import UNKNOWN_VIEWPOINT, Measurement
from solver.uniform.fit import FrameFit, fit_from, start_of
from solver.uniform.problem import Problem, problem_of, without
from solver.uniform.residuals import PSI

STARTS = np.radians([-65.0, -35.0, -10.0, 10.0, 35.0, 65.0])
BENT_AWAY = "the beam appears bent away from the object, as in a plane that is seen nearly edge-on"


def exact_fit_3d(measurement: Measurement) -> Estimate:
    """Estimate contact, force, displacement and psi, with their joint covariance.

    A beam that appears bent to the side where the rig has no object bends in a plane steeper than
    the rays to the camera, almost along them; unless the fit determines psi, the outcome is
    EDGE_ON. A tip that is inconsistent with the points for a beam of the rig's length is an
    occluder's edge: it is left out.
    """
    if not measurement.viewpoint_known:
        return Estimate(Outcome.NOT_IDENTIFIABLE, UNKNOWN_VIEWPOINT)
    estimate = _fit(measurement)
    if estimate.outcome.has_values or len(measurement.points) < THRESHOLDS.min_points:
        return estimate
    refusal = no_contact(nearest_linear_bend(measurement))
    if refusal is not None and refusal.outcome is Outcome.INVALID:
        return replace(estimate, outcome=Outcome.EDGE_ON, message=BENT_AWAY, assumption=None)
    return estimate


def _fit(measurement: Measurement) -> Estimate:
    """Estimate by the fit, for a beam bent to either side."""
    search = _uniform_minima if measurement.uniform else _general_minima
    found = search(measurement, with_tip=True)
    if len(found.problem.arrays.tips):
        tipless = search(measurement, with_tip=False)
        if _contradicted(found.minima, tipless.minima):
            found = tipless
    problem, minima, model, gain = found
    row = PSI if model is None else model.parameters["psi"]
    best = minima[0] if minima else None
    refusal = refusal_of(measurement, problem, best, either_side=True)
    if best is None or (refusal is not None and refusal.outcome is not Outcome.NOT_CONVERGED):
        return refusal or Estimate(Outcome.NOT_CONVERGED)
    spread, close = _spread(best, minima[1:], row)
    sigma = math.sqrt(best.covariance[row, row] + spread[row] ** 2)
    psi = math.degrees(float(best.p[row]))
    if sigma > THRESHOLDS.max_psi_sigma:
        alternatives = "".join(
            f", or {math.degrees(float(minimum.p[row])):.0f}" for minimum in close
        )
        return Estimate(
            Outcome.NOT_IDENTIFIABLE,
            f"the inclination would be {psi:.0f} deg{alternatives}, with a sigma of "
            f"{min(math.degrees(sigma), 180):.0f} deg",
            chi2=best.chi2,
            iterations=best.iterations,
        )
    if _edge_on(problem, float(best.p[row]), 2 * sigma):
        return Estimate(
            Outcome.EDGE_ON,
            f"the inclination of {psi:.0f} deg, with a sigma of {math.degrees(sigma):.1f} deg, "
            "may be that of a plane seen edge-on",
            chi2=best.chi2,
            iterations=best.iterations,
        )
    if refusal is None and model is not None:
        refusal = _other_beam(measurement, problem, best, float(best.p[row]), gain)
    if refusal is not None:
        return refusal
    best = replace(best, covariance=best.covariance + np.outer(spread, spread))
    values, covariance = (
        uniform_values(measurement, best, True)
        if model is None
        else frame_values(measurement, model, best, psi_fitted=True)
    )
    return estimate_from_fit(measurement, problem, best, values, covariance, psi_fitted=True)


class _Found(NamedTuple):
    """Distinct minima of a frame's chi2 over psi, best first; `model` is None of a uniform beam.

    `gain` is that of `SpaceFits`.
    """

    problem: Problem
    minima: list[FrameFit]
    model: FrameProblem | None
    gain: float = 0.0


def _other_beam(
    measurement: Measurement, problem: Problem, fit: FrameFit, psi: float, gain: float
) -> Estimate | None:
    """Refuse an image whose beam, in the plane of inclination `psi`, is not that of its rig."""
    in_order = replace(fit, kept=fit.kept[problem.order])
    in_plane, bowed = partial(problem_in_plane, psi), with_bow(measurement)
    found = prior_conflict(bowed, problem, in_plane(bowed, problem), in_order, gain, in_plane)
    if found is None:
        return None
    return Estimate(
        Outcome.INVALID,
        found.reason,
        chi2=fit.chi2,
        iterations=fit.iterations,
        assumption=found.assumption,
    )


def _uniform_minima(measurement: Measurement, with_tip: bool) -> _Found:
    """Find the minima without outliers; none for too few points."""
    problem = problem_of(measurement, with_tip)
    minima = _minima(problem) if problem.points >= THRESHOLDS.min_points else []
    if minima and not minima[0].kept.all():
        # Outliers bias every start: search again with the inliers of the first search.
        inlier_minima = _minima(without(problem, minima[0].kept))
        minima = [
            fit_from(problem, minimum.p, psi_free=True) for minimum in inlier_minima
        ] or minima
        minima.sort(key=_rank)
    return _Found(problem, minima, None)


def _general_minima(measurement: Measurement, with_tip: bool) -> _Found:
    """Find the minima of the rig's stated or learned beam; none for too few points."""
    bowed = with_bow(measurement)
    problem = problem_of(bowed, with_tip)
    model = frame_problem_of(bowed, problem)
    if problem.points < THRESHOLDS.min_points:
        return _Found(problem, [], model)
    model, fits, gain = fits_in_space(problem, model, STARTS)
    return _Found(problem, _distinct(fits, model.parameters["psi"]), model, gain)


def _contradicted(with_tip: list[FrameFit], without_tip: list[FrameFit]) -> bool:
    """Test whether the tip is inconsistent with the beam of the points."""
    if not without_tip or without_tip[0].status != CONVERGED:
        return False
    if not with_tip or with_tip[0].status != CONVERGED:
        return True
    tip, free = with_tip[0], without_tip[0]
    rejected = int(free.kept.sum()) - int(tip.kept.sum())
    return (
        rejected > 0.05 * len(free.kept)
        or tip.chi2 - free.chi2 > THRESHOLDS.max_tip_chi2 * free.variance_inflation
    )


def _rank(fit: FrameFit) -> tuple[bool, int, float]:
    """Return a sort key: converged fits first, then more kept points, then smaller chi2."""
    return fit.status != CONVERGED, -int(fit.kept.sum()), fit.chi2


def _minima(problem: Problem) -> list[FrameFit]:
    """Find the distinct minima of chi2 reached from the starts, best first."""
    starts = [
        start for start in (start_of(problem, float(psi)) for psi in STARTS) if start is not None
    ]
    return _distinct([fit_from(problem, start, psi_free=True) for start in starts], PSI)


def _distinct(fits: Sequence[FrameFit], row: int) -> list[FrameFit]:
    """Return the fits with different psi, the parameter `row`, best first."""
    distinct: list[FrameFit] = []
    for fit in sorted(fits, key=_rank):
        near = 0.1 * math.sqrt(max(float(fit.covariance[row, row]), 0.0)) + 1e-6
        if all(abs(fit.p[row] - known.p[row]) > near for known in distinct):
            distinct.append(fit)
    return distinct


def _spread(best: FrameFit, minima: list[FrameFit], row: int) -> tuple[Floats, list[FrameFit]]:
    """Compute the additional sigma of the parameters due to other minima; return these too.

    The parameter `row` is psi. Each further minimum is weighted by its likelihood, relative to the
    best's.
    """
    spread, close = np.zeros(len(best.p)), []
    for minimum in minima:
        excess = (minimum.chi2 - best.chi2) / best.variance_inflation
        if (
            minimum.status == CONVERGED
            and excess < THRESHOLDS.close_chi2
            and minimum.kept.sum() == best.kept.sum()
        ):
            likelihood = math.exp(-max(excess, 0.0) / 2)
            deviation = math.sqrt(likelihood / (1 + likelihood)) * (minimum.p - best.p)
            if abs(deviation[row]) > abs(spread[row]):
                spread = deviation
            close.append(minimum)
    return spread, close


def _edge_on(problem: Problem, psi: float, margin: float) -> bool:
    """Test whether psi may be a right angle or that of the camera's rays, tan psi = z_v / y_v."""
    ray = problem.arrays.viewpoint[1]
    edges = [math.copysign(math.pi / 2, psi)]
    if ray != 0:
        edges.append(math.atan(1 / ray))
    return any(abs(psi - edge) < margin for edge in edges)
