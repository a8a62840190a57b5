"""Start of a frame's fit: the uniform beam near the points."""

from dataclasses import replace
from typing import Final

from solver.beams.beam import S_C, Q
from solver.beams.exact import contact_at
from solver.fitting.frame_problem import FrameProblem
from solver.instrument.arrays import Floats
from solver.uniform import residuals
from solver.uniform.fit import start_of
from solver.uniform.problem import Problem

# Largest contact arc length of a start, over the beam's length. Chosen: a uniform beam may be
# nearest to a thin tip with a contact beyond it.
_MAX_START: Final = 0.95


def uniform_start(problem: Problem, rod: FrameProblem, psi: float | None = None) -> Floats | None:
    """Return the parameters (p,) with load, place and clamp of a uniform beam near the points.

    Its inclination is `psi` [rad], or that of the prior. Return None if there is none.
    """
    at = rod.parameters
    inclination = float(rod.mean[at["psi"]]) if psi is None else psi
    uniform = start_of(_straightened(problem, rod), inclination)
    if uniform is None:
        return None
    start = rod.mean.copy()
    start[at["psi"]] = inclination
    start[Q] = uniform[residuals.Q]
    _, _, _, arc = contact_at(uniform[residuals.Q], uniform[residuals.LEVER])
    start[S_C] = min(arc[0], _MAX_START)
    start[at["dx"] : at["tilt"] + 1] = uniform[residuals.DX : residuals.TILT + 1]
    return start


def _straightened(problem: Problem, rod: FrameProblem) -> Problem:
    """Remove the prior's bow from the points: a contact is no start for a beam bowed as far."""
    points = problem.arrays.points.copy()
    for power, coefficient in enumerate(rod.mean[rod.parameters.span("bow")], 2):
        points[residuals.Y] -= coefficient * points[residuals.X] ** power
    return replace(problem, arrays=problem.arrays._replace(points=points))
