"""Fit one contact on a beam of another taper: it may explain what looks like something else.

Friction bends a beam much as a taper does; a fit with another friction shows which of them it is.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, Final, NamedTuple

import numpy as np

from solver.beams.stretch import WIDTHS
from solver.core.least_squares import NormalEquations
from solver.fitting.frame_problem import FrameProblem, frame_problem_of, only
from solver.fitting.frame_start import uniform_start
from solver.fitting.robust_fit import least_squares
from solver.instrument.arrays import Floats
from solver.instrument.beam_shape import FIRST_WIDTH, BeamShape
from solver.instrument.measurement import Measurement
from solver.uniform.problem import Problem

# Sigma of the tip's relative width. Chosen: wires, needles and whiskers lie within two of it.
# Measured: with it one contact explains all frames of a beam of 0.6 at the tip, and none of the 131
# of `results/two_contacts`.
_TAPER: Final = 0.4
# Sigma of the coefficient of friction. Chosen: that of dry rubber, the largest of usual objects.
_FRICTION: Final = 1.0


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
    rod = only(frame_problem(_with_shape(measurement, _with_any_taper(shape)), problem), kept)
    starts = [uniform_start(problem, rod)]
    if near is None:
        near = _near(only(frame_problem(measurement, problem), kept), problem)
    if near is not None:
        starts.append(near if len(shape.widths) else np.insert(near, WIDTHS, 0.0))
    best = _best_fit(rod, starts)
    if best is None:
        return OtherTaper(np.inf, 1.0)
    return OtherTaper(best.objective, 1.0 + float(best.p[rod.parameters.span("widths")].sum()))


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
    rod = only(frame_problem(_with_shape(measurement, rough), problem), kept)
    best = _best_fit(rod, [near, uniform_start(problem, rod)])
    return np.inf if best is None else best.objective


def _with_shape(measurement: Measurement, shape: BeamShape) -> Measurement:
    return replace(measurement, rig=replace(measurement.rig, shape=shape))


def _best_fit(rod: FrameProblem, starts: Sequence[Floats | None]) -> NormalEquations | None:
    """Return the fit of the least sum of squares from some starts; None if none exists."""
    fits = [fit for p in starts if p is not None and (fit := least_squares(rod, p)) is not None]
    return min(fits, key=lambda fit: fit.objective, default=None)


def _near(rod: FrameProblem, problem: Problem) -> Floats | None:
    """Fit the stated beam: its friction and clamp are nearer than those of a uniform beam."""
    start = uniform_start(problem, rod)
    fit = None if start is None else least_squares(rod, start)
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
