"""Test whether one contact on a beam of another taper explains an image as well as two contacts."""

from dataclasses import replace
from typing import Any, Final

import numpy as np

from solver.beam_models.rod import WIDTHS
from solver.fitting.problem import Problem
from solver.fitting.rod_estimate import uniform_start
from solver.fitting.rod_fit import LeastSquares, least_squares
from solver.fitting.rod_problem import only, rod_problem_of
from solver.instrument.beam_shape import FIRST_WIDTH, BeamShape
from solver.instrument.measurement import Measurement

# Sigma of the tip's relative width. Chosen: wires, needles and whiskers lie within two of it.
# Measured: with it one contact explains all frames of a beam of 0.6 at the tip, and none of the 131
# of `results/two_contacts`.
_TAPER: Final = 0.4


def other_taper(measurement: Measurement, problem: Problem, kept: Any) -> tuple[float, float]:
    """Fit one contact on a beam whose taper may be another than the rig states.

    Only the `kept` (n,) points of `problem` are used, which has those of the measurement with its
    bow. Return the sum of squares, infinite where no such beam is near the points, and the width
    of its tip over that at the clamp.
    """
    rig = replace(measurement.rig, shape=_with_any_taper(measurement.rig.shape))
    rod = only(rod_problem_of(replace(measurement, rig=rig), problem), kept)
    start = uniform_start(problem, rod)
    fit: LeastSquares | None = None if start is None else least_squares(rod, start)
    if fit is None:
        return np.inf, 1.0
    return fit.objective, 1.0 + float(fit.p[WIDTHS : WIDTHS + rod.widths].sum())


def _with_any_taper(shape: BeamShape) -> BeamShape:
    """Return the beam with an additional uncertainty of its taper."""
    widths, covariance = shape.widths, np.array(shape.covariance)
    if not len(widths):
        widths = np.zeros(1)
        covariance = np.insert(covariance, FIRST_WIDTH, 0.0, axis=0)
        covariance = np.insert(covariance, FIRST_WIDTH, 0.0, axis=1)
    covariance[FIRST_WIDTH, FIRST_WIDTH] += _TAPER**2
    return replace(shape, widths=widths, covariance=covariance)
