"""Least squares with the exact beam where the deformation plane is unknown too.

Contact, force and the inclination psi are estimated together, from one image (the paper's section
V-B), or with a moment sensor (V-C), further views, or the image of the tip, whichever the
measurement contains. To first order an image shows only the deflection times
cos(psi) - (y_v / z_v) sin(psi); psi is determined by second-order perspective, or by the position
in the image of the tip of a beam of known length. chi2 may have several minima over psi: all are
searched for.
"""

import math
from dataclasses import replace

import numpy as np

from solver.fitting.first_contact import nearest_linear_bend, no_contact
from solver.fitting.fit import FrameFit, fit_from, start_of
from solver.fitting.fit_estimate import estimate_from_fit, refusal_of
from solver.fitting.minimise import CONVERGED
from solver.fitting.problem import Problem, problem_of, without
from solver.fitting.residuals import PSI
from solver.fitting.thresholds import LIMITS
from solver.fitting.values import values_of
from solver.instrument.arrays import Floats
from solver.instrument.estimate import Estimate, Outcome
from solver.instrument.measurement import UNKNOWN_VIEWPOINT, Measurement

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
    if estimate.outcome.has_values or len(measurement.points) < LIMITS.min_points:
        return estimate
    refusal = no_contact(nearest_linear_bend(measurement))
    if refusal is not None and refusal.outcome is Outcome.INVALID:
        return replace(estimate, outcome=Outcome.EDGE_ON, message=BENT_AWAY)
    return estimate


def _fit(measurement: Measurement) -> Estimate:
    """Estimate by the fit, for a beam bent to either side."""
    problem = problem_of(measurement)
    minima = _robust_minima(problem)
    if len(problem.arrays[3]):
        tipless = problem_of(measurement, with_tips=False)
        tipless_minima = _robust_minima(tipless)
        if _contradicted(minima, tipless_minima):
            problem, minima = tipless, tipless_minima
    best = minima[0] if minima else None
    refusal = refusal_of(measurement, problem, best, either_side=True)
    if best is None or (refusal is not None and refusal.outcome is not Outcome.NOT_CONVERGED):
        return refusal or Estimate(Outcome.NOT_CONVERGED)
    spread, close = _spread(best, minima[1:])
    sigma = math.sqrt(best.covariance[PSI, PSI] + spread[PSI] ** 2)
    psi = math.degrees(float(best.p[PSI]))
    if sigma > LIMITS.max_psi_sigma:
        alternatives = "".join(
            f", or {math.degrees(float(minimum.p[PSI])):.0f}" for minimum in close
        )
        return Estimate(
            Outcome.NOT_IDENTIFIABLE,
            f"the inclination would be {psi:.0f} deg{alternatives}, with a sigma of "
            f"{min(math.degrees(sigma), 180):.0f} deg",
            chi2=best.chi2,
            iterations=best.iterations,
        )
    if _edge_on(problem, float(best.p[PSI]), 2 * sigma):
        return Estimate(
            Outcome.EDGE_ON,
            f"the inclination of {psi:.0f} deg, with a sigma of {math.degrees(sigma):.1f} deg, "
            "may be that of a plane seen edge-on",
            chi2=best.chi2,
            iterations=best.iterations,
        )
    if refusal is not None:
        return refusal
    best = replace(best, covariance=best.covariance + np.outer(spread, spread))
    values, covariance = values_of(measurement, best, True)
    return estimate_from_fit(measurement, problem, best, values, covariance, psi_fitted=True)


def _robust_minima(problem: Problem) -> list[FrameFit]:
    """Find the distinct minima of chi2, best first, without outliers; none for too few points."""
    minima = _minima(problem) if problem.points >= LIMITS.min_points else []
    if minima and not minima[0].kept.all():
        # Outliers bias every start: search again with the inliers of the first search.
        inlier_minima = _minima(without(problem, minima[0].kept))
        minima = [
            fit_from(problem, minimum.p, psi_free=True) for minimum in inlier_minima
        ] or minima
        minima.sort(key=_rank)
    return minima


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
        or tip.chi2 - free.chi2 > LIMITS.max_tip_chi2 * free.variance_inflation
    )


def _rank(fit: FrameFit) -> tuple[bool, int, float]:
    """Return a sort key: converged fits first, then more kept points, then smaller chi2."""
    return fit.status != CONVERGED, -int(fit.kept.sum()), fit.chi2


def _minima(problem: Problem) -> list[FrameFit]:
    """Find the distinct minima of chi2 reached from the starts, best first."""
    starts = [
        start for start in (start_of(problem, float(psi)) for psi in STARTS) if start is not None
    ]
    fits = sorted((fit_from(problem, start, psi_free=True) for start in starts), key=_rank)
    distinct: list[FrameFit] = []
    for fit in fits:
        near = 0.1 * math.sqrt(max(float(fit.covariance[PSI, PSI]), 0.0)) + 1e-6
        if all(abs(fit.p[PSI] - known.p[PSI]) > near for known in distinct):
            distinct.append(fit)
    return distinct


def _spread(best: FrameFit, minima: list[FrameFit]) -> tuple[Floats, list[FrameFit]]:
    """Compute the additional sigma of the parameters (8,) due to other minima; return these too.

    Each further minimum is weighted by its likelihood, relative to the best's.
    """
    spread, close = np.zeros(len(best.p)), []
    for minimum in minima:
        excess = (minimum.chi2 - best.chi2) / best.variance_inflation
        if (
            minimum.status == CONVERGED
            and excess < LIMITS.close_chi2
            and minimum.kept.sum() == best.kept.sum()
        ):
            likelihood = math.exp(-max(excess, 0.0) / 2)
            deviation = math.sqrt(likelihood / (1 + likelihood)) * (minimum.p - best.p)
            if abs(deviation[PSI]) > abs(spread[PSI]):
                spread = deviation
            close.append(minimum)
    return spread, close


def _edge_on(problem: Problem, psi: float, margin: float) -> bool:
    """Test whether psi may be a right angle or that of the camera's rays, tan psi = z_v / y_v."""
    rays = problem.arrays[2][:, 1]
    edges = [math.copysign(math.pi / 2, psi)]
    if len(rays) == 1 and rays[0] != 0:
        edges.append(math.atan(1 / rays[0]))
    return any(abs(psi - edge) < margin for edge in edges)
