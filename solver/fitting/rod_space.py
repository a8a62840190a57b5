"""Fit a beam of changing section in a plane of unknown inclination to one frame."""

from dataclasses import replace

import numpy as np

from solver.fitting.fit import FrameFit
from solver.fitting.problem import Problem
from solver.fitting.rod_estimate import uniform_start
from solver.fitting.rod_fit import fit_rod
from solver.fitting.rod_problem import RodProblem
from solver.fitting.rod_tip import spatial
from solver.instrument.arrays import Floats


def fits_in_space(problem: Problem, rod: RodProblem, inclinations: Floats) -> list[FrameFit]:
    """Fit a frame, with the tips of `problem`, from a start at each inclination [rad].

    The parameters are those of `rod`, psi among them; a fit's `kept` (n,) is in the order of the
    measurement's points. Starts without a beam near the points are left out.
    """
    space, fits = spatial(rod, problem), []
    for psi in inclinations:
        start = uniform_start(problem, rod, float(psi))
        fit = None if start is None else fit_rod(space, start)
        if fit is not None:
            kept = np.empty(problem.points, dtype=np.bool_)
            kept[problem.order] = fit.kept[: problem.points]
            fits.append(replace(fit, kept=kept))
    return fits
