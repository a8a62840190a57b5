"""Steps of a fit whose plane is unknown."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from solver.core.least_squares import CONVERGED
from solver.fitting.frame_problem import frame_problem_of
from solver.fitting.robust_fit import residuals_at, robust_fit, uniform_start
from solver.fitting.unknown_plane import SpatialProblem, fits_in_space, spatial
from solver.instrument.beam_shape import stated_shape
from solver.uniform.problem import Problem, problem_of
from tests.draws import generator
from tests.tapered import bent, measured

WIRE = stated_shape(taper=0.02, softness=0.0, section=0.02, friction=0.1)
VIEWPOINT = np.array([0.12, -0.1, 0.36, 1.0])


def inclined(load: float = 1.2) -> tuple[Problem, SpatialProblem]:
    """Points of a beam in plane C, bent by a load [EI / L^2]; the rig does not know its plane."""
    taken = measured(bent(0.01, 0.6, load), WIRE, generator(__name__, 5))
    taken = replace(taken, view=replace(taken.view, viewpoint=VIEWPOINT))
    problem = problem_of(taken, with_tip=False)
    return problem, spatial(frame_problem_of(taken, problem), problem)


@pytest.mark.parametrize("psi", [-0.8, -0.3, 0.3, 0.8])
def test_a_turn_of_the_plane_keeps_the_image_of_the_free_end(psi: float) -> None:
    # To first order: a beam that is bent further comes nearer to the camera.
    problem, space = inclined(load=0.3)
    p = uniform_start(problem, space, psi)
    assert p is not None
    turn = np.zeros(len(p))
    turn[space.parameters["psi"]] = 0.1
    rows = residuals_at(space, p)
    assert rows is not None
    residual, jacobian = rows
    expected = residual + turn @ jacobian

    def error(after: np.ndarray) -> float:
        """Root mean square difference from the straight step, in sigmas, of the last points."""
        moved = residuals_at(space, after)
        assert moved is not None
        return float(np.sqrt(np.mean((moved[0] - expected)[-20:] ** 2)))

    assert error(space.moved(p, turn)) < 0.2 * error(p + turn)


def test_a_fit_converges_from_any_plane() -> None:
    problem, space = inclined()
    fits = []
    for psi in np.radians([-50.0, -25.0, 25.0, 50.0]):
        start = uniform_start(problem, space, float(psi))
        assert start is not None
        fit = robust_fit(space, start)
        assert fit is not None
        assert fit.status == CONVERGED
        fits.append(fit)
    for one, other in pairwise(fits):
        assert one.chi2 == pytest.approx(other.chi2, abs=1e-2)
    # The search makes one fit of a valley.
    found = fits_in_space(problem, space, np.radians([-50.0, -25.0, 25.0, 50.0]))
    assert len(found.fits) == 1
    assert found.fits[0].chi2 == pytest.approx(fits[0].chi2, abs=1e-2)
