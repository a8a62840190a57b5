"""Estimate from one frame of a beam that is not uniform, or not known to be."""

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from solver.beams.beam import FRICTION_RATIO
from solver.core.least_squares import CONVERGED
from solver.core.thresholds import THRESHOLDS
from solver.fitting.frame_problem import FrameProblem, frame_problem_of, only
from solver.fitting.frame_values import frame_values
from solver.fitting.neighbours import Neighbours, neighbours_of, with_neighbours
from solver.fitting.reflected_light import lit_by_object, reflection_matters, touched_place
from solver.fitting.rigid_object import friction_sign_of, with_friction_sign
from solver.fitting.robust_fit import robust_fit, uniform_start
from solver.fitting.stated_beam import prior_conflict
from solver.fitting.verdict import estimate_from_fit, refusal_of
from solver.instrument.arrays import Floats
from solver.instrument.estimate import Estimate, FittedParameter, Outcome
from solver.instrument.measurement import Measurement
from solver.uniform.fit import FrameFit
from solver.uniform.problem import Problem, problem_of


class FrameEstimate(NamedTuple):
    """Estimate of a frame; `shaded` is whether light that the beam lacks explains its residuals."""

    estimate: Estimate
    shaded: bool = False


def frame_estimate(
    measurement: Measurement,
    frame_problem: Callable[[Measurement, Problem], FrameProblem] = frame_problem_of,
) -> FrameEstimate:
    """Estimate contact and force in the known plane, with the rig's stated or learned beam.

    What one image does not determine (section, friction, clamp) has the prior that the rig states,
    and widens the covariance accordingly. `frame_problem` states what kind of force bends the beam.
    The outcome is "invalid" where the beam is not the one that the rig states.
    """
    bowed = with_bow(measurement)
    problem = problem_of(bowed, with_tip=False)
    enough = problem.points >= THRESHOLDS.min_points
    model = frame_problem(bowed, problem) if enough else None
    fitted = None if model is None else fit_with_neighbours(problem, model)
    fit = None if fitted is None else fitted.in_order(problem)
    refusal = refusal_of(measurement, problem, fit)
    if refusal is not None or model is None or fitted is None or fit is None:
        return FrameEstimate(refusal or Estimate(Outcome.NOT_CONVERGED))
    found = prior_conflict(bowed, problem, model, fitted.fit, fitted.gain, frame_problem)
    if found is not None:
        dof = max(int(np.count_nonzero(fit.kept)) - 2, 1)
        return FrameEstimate(
            Estimate(
                Outcome.INVALID, found.reason, chi2=fit.chi2, dof=dof, assumption=found.assumption
            )
        )
    values, covariance = frame_values(
        measurement, fitted.model, fitted.model.with_friction_ratio(fit)
    )
    estimate = estimate_from_fit(measurement, problem, fit, values, covariance, moment_fitted=False)
    shaded = fitted.neighbours is not None and fitted.neighbours.shaded
    if not (model.beam.prior and estimate.values):
        return FrameEstimate(estimate, shaded)
    sigmas = np.sqrt(np.diag(fit.covariance))
    places = {name: model.parameters[name] for name in model.beam.prior}
    own = {name: FittedParameter(float(fit.p[i]), float(sigmas[i])) for name, i in places.items()}
    return FrameEstimate(replace(estimate, parameters=own), shaded)


def with_bow(measurement: Measurement) -> Measurement:
    """Return the measurement with the bow that was removed from its points."""
    if measurement.rest_bow is None:
        return measurement
    view = measurement.view
    points = view.points + measurement.rest_bow.removed
    return replace(measurement, view=replace(view, points=points))


class FittedFrame(NamedTuple):
    """Fit of a frame, and its problem with errors of the frame's own.

    The fit's points are in the order of the problem. `neighbours` are the errors that neighbouring
    points share, None where there are none.
    """

    model: FrameProblem
    fit: FrameFit
    neighbours: Neighbours | None = None

    @property
    def gain(self) -> float:
        """Twice the log likelihood that errors of neighbouring points gain."""
        return 0.0 if self.neighbours is None else self.neighbours.gain

    def in_order(self, problem: Problem) -> FrameFit:
        """Return the fit with its `kept` (n,) in the order of the measurement's points."""
        kept = np.empty_like(self.fit.kept)
        kept[problem.order] = self.fit.kept
        return replace(self.fit, kept=kept)


def fit_frame(problem: Problem, model: FrameProblem) -> FittedFrame | None:
    """Fit a frame from the start of a uniform beam; None if no beam is near the points."""
    start = uniform_start(problem, model)
    fit = None if start is None else _best_fit(model, start)
    if fit is None:
        return None
    alone = model
    if model.rigid is not None:
        model = with_friction_sign(model, friction_sign_of(model, fit.p))
    if reflection_matters(model):
        model = lit_by_object(model, touched_place(model, fit.p))
    return FittedFrame(model, fit if model is alone else refitted(model, fit))


def fit_with_neighbours(problem: Problem, model: FrameProblem) -> FittedFrame | None:
    """Fit a frame as `fit_frame`, beside the errors that neighbouring points share.

    The fit's chi2 is that without them: whether the beam has one contact is judged by all of it.
    """
    fitted = fit_frame(problem, model)
    if fitted is None or fitted.fit.status != CONVERGED:
        return fitted
    neighbours = neighbours_of(fitted.model, fitted.fit.p, fitted.fit.kept)
    if neighbours is None:
        return fitted
    # Outliers stay outliers: such errors could imitate a run of them.
    kept = fitted.fit.kept.copy()
    model = with_neighbours(fitted.model, neighbours)
    fit = refitted(only(model, kept), replace(fitted.fit, kept=kept[kept]))
    kept[kept] = fit.kept
    return FittedFrame(model, replace(fit, kept=kept, chi2=fitted.fit.chi2), neighbours)


def refitted(model: FrameProblem, fit: FrameFit) -> FrameFit:
    """Fit again after errors of the frame's own have been added; they are 0 where that fails."""
    own = len(model.mean) - len(fit.p)
    before = replace(
        fit, p=np.append(fit.p, np.zeros(own)), covariance=np.pad(fit.covariance, (0, own))
    )
    after = robust_fit(model, before.p)
    if after is None or (before.status == CONVERGED and after.status != CONVERGED):
        return before
    return after


def _best_fit(model: FrameProblem, start: Floats) -> FrameFit | None:
    """Fit from the start; where that leaves outliers, also from the best beam without friction.

    Friction bends a beam much as a taper does: with both, there may be several minima.
    """
    fit = robust_fit(model, start)
    smooth = model.free[model.free != FRICTION_RATIO]
    if len(smooth) == len(model.free) or (fit is not None and _rank(fit) == (False, 0)):
        return fit
    held = robust_fit(replace(model, free=smooth), start)
    other = None if held is None else robust_fit(model, held.p)
    fits = [one for one in (fit, other) if one is not None]
    return min(fits, key=lambda one: (*_rank(one), one.chi2), default=None)


def _rank(fit: FrameFit) -> tuple[bool, int]:
    """Return a sort key: converged fits first, then fewer rejected points."""
    return fit.status != CONVERGED, int(np.count_nonzero(~fit.kept))
