"""Fit of a beam with two contacts to one frame: its problem, and starts."""

from collections.abc import Iterator
from itertools import combinations
from typing import Final

import numpy as np
from scipy.integrate import cumulative_trapezoid

from solver.beams.beam import FRICTION_RATIO
from solver.beams.integrated import IntegratedBeam
from solver.beams.stretch import width_at
from solver.beams.two_contacts import TwoContactBeam
from solver.fitting.frame_problem import FrameProblem
from solver.instrument.arrays import Floats
from solver.uniform.residuals import LEAST_SIGMA, SIGMA_X, SIGMA_Y, X, Y

# Places of the grid of starts, in units of the beam's length, and points that it uses. Chosen:
# the fit moves a contact by more than a step of the grid.
_GRID: Final = np.linspace(0.06, 0.98, 24)
_POINTS: Final = 64
# Starts differ in a place by more than this many steps of the grid. Chosen: nearer ones lead to the
# same minimum.
_APART: Final = 3
# Points of the integration of a linear beam. Chosen: its error is far below a step of the grid.
_FINE: Final = 100


def two_contact_problem_of(model: FrameProblem) -> FrameProblem:
    """Add an inner contact to the problem of one contact, with the same prior of its friction."""
    assert isinstance(model.beam, IntegratedBeam), "only this beam may have two contacts"
    assert type(model.beam) is IntegratedBeam, "a beam of a user's own has one contact"
    beam = TwoContactBeam(model.beam)
    size, count = len(model.beam.parameters), len(beam.parameters) - len(model.beam.parameters)
    added = [size] * count
    information = np.insert(np.insert(model.information, added, 0.0, axis=0), added, 0.0, axis=1)
    friction_ratio = beam.parameters["friction_ratio_inner"]
    information[friction_ratio, friction_ratio] = model.information[FRICTION_RATIO, FRICTION_RATIO]
    rubs = [friction_ratio] if FRICTION_RATIO in model.free else []
    others = np.where(model.free < size, model.free, model.free + count)
    inner = beam.parameters.indices("q_inner", "s_c_inner")
    return FrameProblem(
        points=model.points,
        view=model.view,
        beam=beam,
        shared=model.shared,
        mean=np.insert(model.mean, added, 0.0),
        information=information,
        free=np.sort([*others, *inner, *rubs]),
        lost_light=model.lost_light,
    )


def starts_of(problem: FrameProblem, tilt: float, count: int) -> Iterator[Floats]:
    """Yield up to `count` starts (p,), the best first, of a beam whose clamp is turned by `tilt`.

    Each is the best linear beam of the prior's section, with contacts at two places of a grid;
    offset and tilt of the clamp are fitted with their prior. Linear theory is applied to the
    integral of the tangent's angle over the arc length, whose second derivative is the curvature
    for any deflection.
    """
    points = problem.points[:, :: max(problem.points.shape[1] // _POINTS, 1)]
    weight = 1 / np.maximum(np.hypot(points[SIGMA_X], points[SIGMA_Y]), LEAST_SIGMA)
    s, y = _unrolled(points, tilt)
    at, beam = problem.parameters, problem.beam
    assert isinstance(beam, TwoContactBeam), "the problem has two contacts"
    widths, bow = problem.mean[at.span("widths")], problem.mean[at.span("bow")]
    y = y - sum(b * s ** (2 + i) for i, b in enumerate(bow))
    bends = _bends(s, np.ascontiguousarray(widths)) * weight
    clamp = np.array([weight, s * weight])
    rows = at.indices("dy", "tilt")
    inverse = np.linalg.inv(clamp @ clamp.T + problem.information[np.ix_(rows, rows)])
    # Eliminate the clamp (Schur complement).
    columns = np.concatenate([bends, [y * weight]])
    by_clamp = columns @ clamp.T
    normal = columns @ columns.T - by_clamp @ inverse @ by_clamp.T
    pairs = np.array(list(combinations(range(len(_GRID)), 2)))
    one, other = pairs.T
    norm, mixed, other_norm = normal[one, one], normal[one, other], normal[other, other]
    determinant = np.maximum(norm * other_norm - mixed**2, 1e-12 * norm * other_norm + 1e-300)
    right = normal[pairs, -1]
    forces = np.column_stack(
        [
            (other_norm * right[:, 0] - mixed * right[:, 1]) / determinant,
            (norm * right[:, 1] - mixed * right[:, 0]) / determinant,
        ]
    )
    # Reduction of the sum of squares by each pair.
    gains = (forces * right).sum(axis=1)
    for _ in range(count):
        best = int(np.argmax(gains))
        start = problem.mean.copy()
        start[beam.places] = _GRID[pairs[best]][::-1]
        start[beam.forces] = forces[best][::-1]
        start[at["tilt"]] = tilt
        yield start
        gains[(np.abs(pairs - pairs[best]) <= _APART).all(axis=1)] = -np.inf


def _bends(s: Floats, widths: Floats) -> Floats:
    """Compute the deflections (g, n) at arc lengths s (n,) by a force of EI at each of _GRID."""
    fine = np.linspace(0.0, max(float(s[-1]), _GRID[-1]), _FINE)
    terms = np.empty(len(widths))
    width = np.array([width_at(x, widths, terms)[0] for x in fine])
    curvature = np.maximum(_GRID[:, None] - fine, 0.0) / width**4
    slope = cumulative_trapezoid(curvature, fine, initial=0.0)
    deflections = cumulative_trapezoid(slope, fine, initial=0.0)
    return np.array([np.interp(s, fine, row) for row in deflections])


def _unrolled(points: Floats, tilt: float) -> tuple[Floats, Floats]:
    """Compute arc length (n,), and integral (n,) of the tangent's angle over it, at sorted points.

    The angle is against the direction of `tilt`.
    """
    cosine, sine = np.cos(tilt), np.sin(tilt)
    x = np.concatenate([[0.0], cosine * points[X] + sine * points[Y]])
    y = np.concatenate([[0.0], cosine * points[Y] - sine * points[X]])
    step = np.hypot(np.diff(x), np.diff(y))
    angle = np.arctan2(np.diff(y), np.diff(x))
    return np.cumsum(step), y[1:] + np.cumsum((angle - np.sin(angle)) * step)
