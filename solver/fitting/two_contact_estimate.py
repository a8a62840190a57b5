"""Estimate from one frame of a beam that touches at two places, in the known plane."""

import math
from typing import Final

import numpy as np

from solver.beams.beam import FRICTION_RATIO
from solver.core.least_squares import CONVERGED, NormalEquations
from solver.core.robust import noise_chi2
from solver.core.thresholds import THRESHOLDS
from solver.fitting import frames
from solver.fitting.frame_estimate import with_bow
from solver.fitting.frame_problem import FrameProblem, frame_problem_of
from solver.fitting.frame_values import (
    force_variance_second_order,
    input_variances,
    mounted_contact,
)
from solver.fitting.reflected_light import lit_by_object, places_of, reflection_matters
from solver.fitting.robust_fit import least_squares, robust_fit
from solver.fitting.stated_beam import fit_alternative_taper
from solver.fitting.two_contact_problem import starts_of, two_contact_problem_of
from solver.fitting.verdict import classified_estimate
from solver.instrument.arrays import Floats
from solver.instrument.estimate import Assumption, Estimate, Outcome
from solver.instrument.measurement import Measurement
from solver.uniform.fit import FrameFit, start_of
from solver.uniform.problem import Problem, problem_of
from solver.uniform.residuals import TILT as START_TILT

# Largest number of starts. Measured: the minimum is reached from the first one but for forces near
# the noise.
_STARTS: Final = 5
# Parameters of two contacts: their forces and places.
_OF_CONTACTS: Final = 4
# Least inner force over the outer one. Measured: a single contact with friction of 0.3 looks like
# an additional inner force of 0.02 to 0.06, one in an unknown inclined plane like one of 0.11.
_LEAST_INNER: Final = 0.2
# Names of the outer contact's values, by those of a single contact.
_SECOND: Final = {
    name: f"second_{name}"
    for name in (
        "s_c_m",
        "force_n",
        *(f"contact_antenna_{axis}_m" for axis in "xyz"),
        *(f"force_{axis}_n" for axis in "xyz"),
    )
}


def two_contact_estimate(measurement: Measurement) -> Estimate:
    """Estimate two contacts and their forces, with the joint covariance of all values.

    The beam is the stated or learned one of the rig, as in `frame_estimate`. The inner contact has
    the names of a single one, the outer one those of `second_...`. The outcome is "invalid" where
    such a beam does not explain the points, and "not identifiable" where the image shows a second
    contact but does not determine it, or where one contact on a beam of another taper than the rig
    states explains the points as well.
    """
    bowed = with_bow(measurement)
    problem = problem_of(bowed, with_tip=False)
    if problem.points < THRESHOLDS.min_points:
        return Estimate(Outcome.NOT_IDENTIFIABLE, f"{problem.points} visible points")
    double = two_contact_problem_of(frame_problem_of(bowed, problem))
    single = start_of(problem, float(double.mean[double.parameters["psi"]]))
    fit = _best_fit(double, 0.0 if single is None else float(single[START_TILT]))
    if fit is not None and fit.status == CONVERGED and reflection_matters(double):
        double = _lit_at_both(double, fit)
        fit = robust_fit(double, np.append(fit.p, np.zeros(double.own_errors)))
    if fit is None or fit.status != CONVERGED:
        return Estimate(Outcome.NOT_CONVERGED, "no beam with two contacts is near the points")
    count = int(np.count_nonzero(fit.kept))
    dof = max(count - _OF_CONTACTS, 1)
    for outcome, reason, assumption in (
        (Outcome.INVALID, _misfit(fit, dof) or _no_inner(double, fit), None),
        (
            Outcome.NOT_IDENTIFIABLE,
            _undetermined(double, fit, "outer"),
            Assumption.ONE_CONTACT,
        ),
        (Outcome.INVALID, _impossible(measurement, double, fit), None),
        (Outcome.NOT_IDENTIFIABLE, _taper_instead(bowed, problem, fit), Assumption.TAPER),
    ):
        if reason:
            return Estimate(outcome, reason, chi2=fit.chi2, dof=dof, assumption=assumption)
    values, covariance = two_contact_values(measurement, double, fit)
    rejected = len(fit.kept) - count
    return classified_estimate(
        measurement.rig,
        values,
        covariance,
        f"{rejected} of {len(fit.kept)} points were rejected" if rejected else "",
        chi2=fit.chi2,
        dof=dof,
        iterations=fit.iterations,
    )


def _best_fit(problem: FrameProblem, tilt: float) -> FrameFit | None:
    """Fit from the start that leads to the smallest sum of squares; None if none converges."""
    best: NormalEquations | None = None
    count = problem.points.shape[1]
    for start in starts_of(problem, tilt, _STARTS):
        minimum = least_squares(problem, start)
        if minimum is not None and (best is None or minimum.objective < best.objective):
            best = minimum
        if best is not None and best.objective < count * noise_chi2(count):
            break
    return None if best is None else robust_fit(problem, best.p)


def _lit_at_both(problem: FrameProblem, fit: FrameFit) -> FrameProblem:
    """Add the light that the objects reflect at both contacts of a fit."""
    bent = problem.bent(fit.p)
    assert bent is not None, "the fit has a shape"
    for touch in places_of(bent):
        problem = lit_by_object(problem, touch)
    return problem


def _misfit(fit: FrameFit, dof: int) -> str:
    """Return why the points are not as near to the beam as their noise, or ""."""
    rejected = 1 - float(fit.kept.mean())
    if rejected > THRESHOLDS.max_rejected_beside_two:
        return f"{100 * rejected:.0f} % of the points do not fit a beam with two contacts"
    if fit.chi2 / dof > noise_chi2(dof):
        return f"a beam with two contacts leaves a chi2 of {fit.chi2 / dof:.1f} per degree"
    return ""


def _taper_instead(measurement: Measurement, problem: Problem, fit: FrameFit) -> str:
    """Return how one contact explains the points with another taper of the beam, or ""."""
    chi2, tip = fit_alternative_taper(measurement, problem, fit.kept)
    count = int(np.count_nonzero(fit.kept))
    if chi2 > count * noise_chi2(count):
        return ""
    return f"one contact on a beam with a tip of {tip:.2f} times its width, or two contacts"


def _undetermined(problem: FrameProblem, fit: FrameFit, name: str) -> str:
    """Return why the fit does not determine the "inner" or "outer" contact, or ""."""
    q, s = problem.parameters.indices(
        *(("q", "s_c") if name == "outer" else ("q_inner", "s_c_inner"))
    )
    force_sigma, place_sigma = np.sqrt(np.diag(fit.covariance)[[q, s]])
    if abs(fit.p[q]) < THRESHOLDS.contact_sigmas * force_sigma:
        return f"the {name} force is {abs(fit.p[q]) / force_sigma:.1f} sigmas"
    if place_sigma > THRESHOLDS.weak_sigma:
        return f"the place of the {name} contact is not determined"
    return ""


def _no_inner(problem: FrameProblem, fit: FrameFit) -> str:
    """Return why the fit does not show an inner contact, or ""."""
    outer, inner = np.abs(fit.p[problem.parameters.indices("q", "q_inner")])
    if inner < _LEAST_INNER * outer:
        return f"the inner force is only {inner / outer:.2g} of the outer one"
    return _undetermined(problem, fit, "inner")


def _impossible(measurement: Measurement, problem: FrameProblem, fit: FrameFit) -> str:
    """Return why two places are not those of two contacts on the beam, or ""."""
    places = problem.parameters.indices("s_c", "s_c_inner")
    outer, inner = fit.p[places]
    covariance = fit.covariance[np.ix_(places, places)]
    difference = np.array([1.0, -1.0])
    apart = math.sqrt(max(float(difference @ covariance @ difference), 0.0))
    if outer - inner < THRESHOLDS.contact_sigmas * apart:
        return "the two contacts are not apart"
    rig = measurement.rig
    length = rig.beam.length
    sigma = math.hypot(math.sqrt(covariance[0, 0]), rig.tolerances.beam_length / length)
    if outer > rig.free_length / length + THRESHOLDS.beyond_tip_sigmas * sigma:
        return "the outer contact is beyond the tip"
    return ""


def two_contact_values(
    measurement: Measurement, problem: FrameProblem, fit: FrameFit
) -> tuple[dict[str, float], Floats]:
    """Compute the values of a fit by name, and their joint covariance.

    The inner contact has the names of a single one, the outer one those of `second_...`.
    """
    count, at, bent = len(fit.p), problem.parameters, problem.bent(fit.p)
    assert bent is not None, "the fit has a shape"
    values: dict[str, float] = {}
    by_variables, by_poses, curved = [], [], []
    for i, (names, friction_ratio) in enumerate(
        (
            ({name: name for name in frames.NAMES}, at["friction_ratio_inner"]),
            (_SECOND, FRICTION_RATIO),
        )
    ):
        contact, by_variable = mounted_contact(
            measurement.rig, at, fit.p, measurement.motor_angle or 0.0, bent, i
        )
        estimated, by_contact, by_pose = frames.with_jacobians(
            measurement, contact, clamp_fitted=True
        )
        # A force has a magnitude; its sign is that of the components.
        sign = math.copysign(1.0, estimated["force_n"])
        estimated["force_n"] *= sign
        labels = list(estimated)
        by_contact[labels.index("force_n")] *= sign
        kept = [k for k, label in enumerate(labels) if label in names]
        values |= {names[labels[k]]: estimated[labels[k]] for k in kept}
        by_variables.append((by_contact @ by_variable)[kept])
        by_poses.append(by_pose[kept])
        friction_ratio_sigma = math.sqrt(fit.covariance[friction_ratio, friction_ratio])
        curved.append(
            force_variance_second_order(
                estimated["force_n"], float(fit.p[friction_ratio]), friction_ratio_sigma
            )
        )
    covariance = np.zeros((count + 3, count + 3))
    covariance[:count, :count] = fit.covariance
    covariance[range(count, count + 3), range(count, count + 3)] = input_variances(measurement)
    total = np.concatenate(by_variables)
    result = total @ covariance @ total.T
    result += frames.pose_covariance(measurement, np.concatenate(by_poses))
    for name, variance in zip(("force_n", "second_force_n"), curved, strict=True):
        row = list(values).index(name)
        result[row, row] += variance
    return values, np.asarray(result)
