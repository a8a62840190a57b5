"""Fit a beam of changing section in a plane of unknown inclination to one frame."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from solver.core.least_squares import CONVERGED
from solver.fitting.frame_estimate import refitted
from solver.fitting.frame_problem import FrameProblem, frame_problem_of
from solver.fitting.frame_start import uniform_start
from solver.fitting.neighbours import neighbours_of, with_neighbours
from solver.fitting.rigid_object import friction_sign_of, with_friction_sign
from solver.fitting.robust_fit import least_squares, robust_fit
from solver.fitting.spatial_problem import spatial
from solver.instrument.arrays import Floats
from solver.instrument.measurement import Measurement
from solver.uniform.fit import FrameFit
from solver.uniform.problem import Problem


class SpaceFits(NamedTuple):
    """Fits of a frame from several starts, and their problem with errors of the frame's own.

    `gain` is twice the log likelihood that errors of neighbouring points gain, 0 without them.
    """

    rod: FrameProblem
    fits: list[FrameFit]
    gain: float


def fits_in_space(problem: Problem, rod: FrameProblem, inclinations: Floats) -> SpaceFits:
    """Fit a frame, with the tips of `problem`, from a start at each inclination [rad].

    The parameters are those of `rod`, psi among them; a fit's `kept` (n,) is in the order of the
    measurement's points. Starts without a beam near the points are left out. Errors that
    neighbouring points share, and the direction of friction at a rigid object, are those of the
    best fit.
    """
    space = spatial(rod, problem)
    tried = (uniform_start(problem, rod, float(psi)) for psi in inclinations)
    starts = _lowest(space, [start for start in tried if start is not None])
    fits = [fit for start in starts if (fit := robust_fit(space, start))]
    gain = 0.0
    if fits:
        best = _best(fits)
        if rod.rigid is not None:
            rod = with_friction_sign(rod, friction_sign_of(rod, best.p))
            space = spatial(rod, problem)
            fits = [refitted(space, fit) for fit in fits]
            best = _best(fits)
        neighbours = neighbours_of(space, best.p, best.kept)
        if neighbours is not None:
            rod = with_neighbours(rod, neighbours)
            space = spatial(rod, problem)
            fits, gain = [refitted(space, fit) for fit in fits], neighbours.gain
    return SpaceFits(rod, [_in_order(problem, fit) for fit in fits], gain)


def _best(fits: list[FrameFit]) -> FrameFit:
    return min(fits, key=lambda fit: (fit.status != CONVERGED, fit.chi2))


def problem_in_plane(psi: float, measurement: Measurement, problem: Problem) -> FrameProblem:
    """Return the problem of a frame in the plane of inclination `psi` [rad]."""
    rod = frame_problem_of(measurement, problem)
    mean, index = rod.mean.copy(), rod.parameters["psi"]
    mean[index] = psi
    return replace(rod, mean=mean, free=rod.free[rod.free != index])


def _lowest(space: FrameProblem, starts: list[Floats]) -> list[Floats]:
    """Fit from each start with psi held; return the fits lower than those beside them.

    Where an image hardly shows psi, the objective is a long flat valley, along which a fit creeps:
    one fit in each valley is enough. Starts are in the order of psi.
    """
    held = replace(space, free=space.free[space.free != space.parameters["psi"]])
    fits = [fit for start in starts if (fit := least_squares(held, start))]
    objectives = [np.inf, *(fit.objective for fit in fits), np.inf]
    return [
        fit.p
        for fit, before, after in zip(fits, objectives, objectives[2:], strict=False)
        if fit.objective <= min(before, after)
    ]


def _in_order(problem: Problem, fit: FrameFit) -> FrameFit:
    """Return a fit of points only, in the order of the measurement."""
    kept = np.empty(problem.points, dtype=np.bool_)
    kept[problem.order] = fit.kept[: problem.points]
    return replace(fit, kept=kept)
