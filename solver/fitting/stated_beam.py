"""Test whether the beam of an image is the one that the rig states.

One contact on a beam of another taper may explain what looks like something else. Friction bends a
beam much as a taper does; a fit with another friction shows which of them it is.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, Final, NamedTuple

import numpy as np

from solver.beams.beam import FRICTION_RATIO
from solver.beams.stretch import WIDTHS
from solver.core.least_squares import NormalEquations
from solver.fitting.frame_problem import FrameProblem, frame_problem_of, only
from solver.fitting.robust_fit import least_squares, uniform_start
from solver.instrument.arrays import Floats
from solver.instrument.beam_shape import FIRST_WIDTH, BeamShape
from solver.instrument.estimate import Assumption
from solver.instrument.measurement import Measurement
from solver.uniform.fit import FrameFit
from solver.uniform.problem import Problem

# Sigmas of chi2 beyond which the parameters are not those that the rig states. Derived: nine
# parameters are so by chance once in ten thousand images. Of 600 images with true statements none
# had one sigma, because an image determines few of them.
_LARGEST: Final = 6.0
# Difference of two sums of squares, from which one explanation is better. Derived: three sigmas of
# one parameter.
_DISTINCT: Final = 9.0
# Sigma of the tip's relative width. Chosen: wires, needles and whiskers lie within two of it.
# Measured: with it one contact explains all frames of a beam of 0.6 at the tip, and none of the 131
# of `results/two_contacts`.
_TAPER: Final = 0.4
# Sigma of the coefficient of friction. Chosen: that of dry rubber, the largest of usual objects.
_FRICTION: Final = 1.0


class PriorConflict(NamedTuple):
    """How an image contradicts its rig, as a sentence, and which statement it contradicts most."""

    reason: str
    assumption: Assumption | None


def prior_conflict(
    measurement: Measurement,
    problem: Problem,
    stated_model: FrameProblem,
    fit: FrameFit,
    gain: float,
    frame_problem: Callable[[Measurement, Problem], FrameProblem],
) -> PriorConflict | None:
    """Return how an image contradicts the beam that its rig states; None if it does not.

    `stated_model` is what `frame_problem` makes of measurement and problem. Either the fit is too
    far from the rig's statements, or errors that neighbouring points share, which gain `gain` in
    twice the log likelihood, explain the points worse than another taper does: such errors could
    hide it.
    """
    model = only(stated_model, fit.kept)
    p = fit.p[: len(model.mean)]
    stated = model.free[np.diag(model.information)[model.free] > 0]
    away = (p - model.mean)[stated]
    information = model.information[np.ix_(stated, stated)]
    chi2 = float(away @ information @ away)
    if chi2 > len(stated) + _LARGEST * math.sqrt(2 * len(stated)):
        contradicted = _most_contradicted(_statements(model), stated, away, information)
        own = model.beam.prior.get(str(contradicted))
        if own is not None:
            return PriorConflict(
                f"the beam is {math.sqrt(chi2):.0f} sigmas from its prior, most by its parameter "
                f"'{contradicted}': it is {p[model.parameters[str(contradicted)]]:.4g}, its prior "
                f"{own.mean:.4g} +- {own.sigma:.4g}",
                None,
            )
        assumption = contradicted if isinstance(contradicted, Assumption) else None
        most = "" if assumption is None else f", most by the {assumption}"
        return PriorConflict(
            f"the beam, its clamp or the friction is {math.sqrt(chi2):.0f} sigmas from what "
            f"rig.json states{most}: correct beam_shape, or learn the beam",
            assumption,
        )
    least = least_squares(model, p) if gain else None
    if least is None:
        return None
    other = fit_alternative_taper(measurement, problem, fit.kept, frame_problem, p)
    if least.objective - other.objective < gain:
        return None
    assumption = Assumption.TAPER
    if model.of_friction_ratio is Assumption.FRICTION:
        friction = with_other_friction(measurement, problem, fit.kept, frame_problem, p)
        assumption = _taper_or_friction(other.objective, friction)
    return PriorConflict(
        f"the beam is not that of rig.json: with a tip {other.tip:.2f} times as wide as at the "
        "clamp it fits better; state beam_shape.taper_sigma, or friction_sigma of rough objects, "
        "or learn the beam",
        assumption,
    )


def _taper_or_friction(with_taper: float, with_friction: float) -> Assumption:
    """Name what explains the points, from the sums of squares with either."""
    if abs(with_taper - with_friction) < _DISTINCT:
        return Assumption.TAPER_OR_FRICTION
    return Assumption.TAPER if with_taper < with_friction else Assumption.FRICTION


def _statements(model: FrameProblem) -> dict[Assumption | str | None, list[int]]:
    """Return the parameters of a problem that belong to each statement of the rig.

    Those of None, errors that all points share, belong to no statement; those of a user's own beam
    have their names.
    """
    at = model.parameters
    return {
        model.of_friction_ratio: [FRICTION_RATIO],
        Assumption.TAPER: at.indices("widths"),
        Assumption.BOW: at.indices("bow"),
        Assumption.PLANE: at.indices("psi"),
        Assumption.CLAMP: at.indices("dx", "dy", "tilt", "softness"),
        **{name: at.indices(name) for name in model.beam.prior},
        None: at.indices("errors"),
    }


def _most_contradicted(
    groups: dict[Assumption | str | None, list[int]],
    stated: Floats,
    away: Floats,
    information: Floats,
) -> Assumption | str | None:
    """Return the statement without which the deviation `away` (s,) would be the least.

    `stated` (s,) are the indices of the parameters, `information` (s, s) is that of their prior.
    """
    gradient = information @ away

    def decrease(indices: list[int]) -> float:
        rows = np.flatnonzero(np.isin(stated, indices))
        block = information[np.ix_(rows, rows)]
        return float(gradient[rows] @ np.linalg.pinv(block, hermitian=True) @ gradient[rows])

    return max(groups, key=lambda name: decrease(groups[name]))


class OtherTaper(NamedTuple):
    """Sum of squares of a fit with another taper, and the width of the tip over the clamp's."""

    objective: float
    tip: float


def fit_alternative_taper(
    measurement: Measurement,
    problem: Problem,
    kept: Any,
    frame_problem: Callable[[Measurement, Problem], FrameProblem] = frame_problem_of,
    near: Floats | None = None,
) -> OtherTaper:
    """Fit one contact on a beam whose taper may be another than the rig states.

    Only the `kept` (n,) points of `problem` are used, which has those of the measurement with its
    bow. The sum of squares is infinite where no such beam is near the points. `frame_problem`
    states what kind of force bends the beam, and `near` (p,) are the parameters of a fit of the
    stated beam.
    """
    shape = measurement.rig.shape
    model = only(frame_problem(_with_shape(measurement, _with_any_taper(shape)), problem), kept)
    starts = [uniform_start(problem, model)]
    if near is None:
        near = _near(only(frame_problem(measurement, problem), kept), problem)
    if near is not None:
        starts.append(near if len(shape.widths) else np.insert(near, WIDTHS, 0.0))
    best = _best_fit(model, starts)
    if best is None:
        return OtherTaper(np.inf, 1.0)
    return OtherTaper(best.objective, 1.0 + float(best.p[model.parameters.span("widths")].sum()))


def with_other_friction(
    measurement: Measurement,
    problem: Problem,
    kept: Any,
    frame_problem: Callable[[Measurement, Problem], FrameProblem],
    near: Floats,
) -> float:
    """Return the sum of squares of one contact whose friction may be more than the rig states.

    The arguments are those of `fit_alternative_taper`; it is infinite where no such beam is near
    the points.
    """
    shape = measurement.rig.shape
    rough = replace(shape, friction_sigma=math.hypot(shape.friction_sigma, _FRICTION))
    model = only(frame_problem(_with_shape(measurement, rough), problem), kept)
    best = _best_fit(model, [near, uniform_start(problem, model)])
    return np.inf if best is None else best.objective


def _with_shape(measurement: Measurement, shape: BeamShape) -> Measurement:
    return replace(measurement, rig=replace(measurement.rig, shape=shape))


def _best_fit(model: FrameProblem, starts: Sequence[Floats | None]) -> NormalEquations | None:
    """Return the fit of the least sum of squares from some starts; None if none exists."""
    fits = [fit for p in starts if p is not None and (fit := least_squares(model, p)) is not None]
    return min(fits, key=lambda fit: fit.objective, default=None)


def _near(model: FrameProblem, problem: Problem) -> Floats | None:
    """Fit the stated beam: its friction and clamp are nearer than those of a uniform beam."""
    start = uniform_start(problem, model)
    fit = None if start is None else least_squares(model, start)
    return None if fit is None else fit.p


def _with_any_taper(shape: BeamShape) -> BeamShape:
    """Return the beam with an additional uncertainty of its taper."""
    widths, covariance = shape.widths, np.array(shape.covariance)
    if not len(widths):
        widths = np.zeros(1)
        covariance = np.insert(covariance, FIRST_WIDTH, 0.0, axis=0)
        covariance = np.insert(covariance, FIRST_WIDTH, 0.0, axis=1)
    covariance[FIRST_WIDTH, FIRST_WIDTH] += _TAPER**2
    return replace(shape, widths=widths, covariance=covariance)
