"""Find the push, and the known force, that would determine best what is left uncertain of a beam.

To first order a push adds its information on the beam (a Schur complement), whatever its images
will show; the best one reduces the sigma of contact distances most (Atkinson and Donev 1992, the
criterion V). Images do not determine EI, but a known force does, the better the more accurately its
image gives the force over EI.
"""

from dataclasses import replace
from itertools import product
from typing import Final, NamedTuple

import numpy as np

from solver.beams.beam import S_C, Q
from solver.beams.curve import END, U, interpolated
from solver.beams.linear import unit_deflection
from solver.fitting.frame_problem import FrameProblem
from solver.fitting.robust_fit import residuals_at
from solver.instrument.arrays import Floats
from solver.instrument.transforms import turn_about_z
from solver.uniform.residuals import SIGMA_X, SIGMA_Y

# Contacts and deflections of the tip that are compared, over the beam's length, and at which the
# sigma of x_c is averaged. Chosen: those of usual pushes.
PLACES: Final = (0.3, 0.45, 0.6, 0.75, 0.9)
DEFLECTIONS: Final = (0.05, 0.1, 0.2)
# Rows of the force over EI and of x_c in `BentBeam.contacts`.
_FORCE, _X_C = 0, 2
# Ratio of the sigmas of EI without and with a known force below which it is not advised. Chosen.
_WORTH: Final = 1.5


class NextPush(NamedTuple):
    """A push at the arc length `place` that deflects the tip by `deflection`, over the length.

    `before` and `after` are the RMS sigma of x_c in usual pushes, over the length, without and with
    this one.
    """

    place: float
    deflection: float
    before: float
    after: float


class NextForce(NamedTuple):
    """A known force [EI / L^2] at the arc length `place` that deflects the tip by `deflection`.

    These are over the length. `before` and `after` are the relative sigmas of EI without and with
    it, of a force that is known exactly.
    """

    force: float
    place: float
    deflection: float
    before: float
    after: float


class _Image(NamedTuple):
    """Information (f, f) of the image of a push, and the gradient (f,) of its x_c.

    `load` is the force over EI [L^-2], and `by_load` (f,) the gradient of its logarithm.
    """

    information: Floats
    gradient: Floats
    load: float
    by_load: Floats


def next_push(problem: FrameProblem, correlation: float, shifted: bool = False) -> NextPush | None:
    """Compare pushes by what they would add to the beam of `problem`, which has its covariance.

    Images have as many points as that of `problem`, as accurate, with the residuals' correlation
    length `correlation`. The clamp's place is a part of the beam if it is `shifted`. Return None if
    the beam has no uncertain parameters.
    """
    of_clamp = ("softness", "dx") if shifted else ("softness",)
    parameters = problem.parameters.indices(*of_clamp, "psi", "widths", "bow")
    beam = [i for i in parameters if i in problem.free]
    if not beam:
        return None
    rows = [list(problem.free).index(i) for i in beam]
    prior = problem.information[np.ix_(problem.free, problem.free)]
    # Load and place, which come first, have no prior.
    known = _information_of(prior[2:, 2:], np.array(rows) - 2)
    possible = _images(problem, correlation)

    def sigma(added: Floats) -> float:
        variances = []
        for image in possible.values():
            total = prior + image.information
            total[np.ix_(rows, rows)] += added
            variances.append(image.gradient @ np.linalg.solve(total, image.gradient))
        return float(np.sqrt(np.mean(variances)))

    before = sigma(np.zeros((len(rows), len(rows))))
    reached = {}
    for one, image in possible.items():
        # What the image adds to the beam, the contact and the clamp's pose being unknown.
        reached[one] = sigma(_information_of(prior + image.information, np.array(rows)) - known)
    best = min(reached, key=lambda one: reached[one])
    return NextPush(*best, before, reached[best])


def next_force(problem: FrameProblem, correlation: float, rigidity: float) -> NextForce | None:
    """Find the push whose force, if it were known, would determine EI best.

    `rigidity` is the relative sigma of EI; the other arguments are those of `next_push`. Return
    None if no force would determine it much better than it is known.
    """
    prior = problem.information[np.ix_(problem.free, problem.free)]
    images, sigmas = _images(problem, correlation), {}
    for one, image in images.items():
        variance = image.by_load @ np.linalg.solve(prior + image.information, image.by_load)
        sigmas[one] = float(np.sqrt(variance))
    best = min(sigmas, key=lambda one: sigmas[one])
    if sigmas[best] * _WORTH > rigidity:
        return None
    return NextForce(images[best].load, *best, rigidity, sigmas[best])


def _images(problem: FrameProblem, correlation: float) -> dict[tuple[float, float], _Image]:
    """Imagine the images of all pushes that are possible, by place and deflection."""
    settings = product(PLACES, DEFLECTIONS)
    images = {one: _image(problem, *one, correlation) for one in settings}
    return {one: image for one, image in images.items() if image is not None}


def _information_of(total: Floats, rows: Floats) -> Floats:
    """Return the information on the parameters `rows` alone, the others being unknown."""
    return np.asarray(np.linalg.inv(np.linalg.inv(total)[np.ix_(rows, rows)]))


def _image(
    problem: FrameProblem, place: float, deflection: float, correlation: float
) -> _Image | None:
    """Imagine the image of a push; None if the beam cannot be bent in this way."""
    p = imagined_push(problem, place, deflection)
    points = points_of_push(problem, p)
    if points is None:
        return None
    count = points.shape[1]
    imagined = replace(
        problem,
        points=points,
        view=problem.view,
        shared=np.zeros((count, problem.shared.shape[1])),
    )
    linearised, bent = residuals_at(imagined, p), problem.bent(p)
    if linearised is None or bent is None:
        return None
    jacobian = linearised.jacobian[problem.free]
    (values,), (by_shape,) = bent.contacts, bent.by_contacts
    gradients = np.zeros((2, len(p)))
    load = float(values[_FORCE])
    gradients[:, : by_shape.shape[1]] = by_shape[_X_C], by_shape[_FORCE] / load
    gradient, by_load = gradients[:, problem.free]
    return _Image(jacobian @ jacobian.T / correlation, gradient, load, by_load)


def imagined_push(problem: FrameProblem, place: float, deflection: float) -> Floats:
    """Return the parameters (p,) of a push at a place that deflects the tip, over the length."""
    p = problem.mean.copy()
    # The load by the linear theory of a uniform beam.
    p[Q], p[S_C] = 6 * deflection / float(unit_deflection(1.0, place)), place
    return p


def points_of_push(problem: FrameProblem, p: Floats) -> Floats | None:
    """Place the points of `problem` (4, n) evenly on the shape with parameters p; None if none."""
    bent, at = problem.bent(p), problem.parameters
    if bent is None:
        return None
    curve = bent.curve
    lever, height, angle = curve.base
    # The unloaded end is nearly straight.
    first, contact = curve.nodes[U, 0], curve.nodes[U, curve.contact]
    tip = contact + (first - contact) * (1 - p[S_C]) / (END - p[S_C])
    count = problem.points.shape[1]
    u = np.linspace(lever, tip, count + 1)[1:]
    nodes = np.clip(np.searchsorted(curve.nodes[U], u) - 1, 0, curve.nodes.shape[1] - 2)
    fits = [interpolated(curve.nodes, int(i), float(at)) for i, at in zip(nodes, u, strict=True)]
    value, slope = np.array([fit[0] for fit in fits]), np.array([fit[1] for fit in fits])
    turn = angle + p[at["tilt"]] + p[at["softness"]] * bent.moment
    rotation = turn_about_z(turn)[:2, :2]
    # P decreases along the beam as u does.
    along, across = lever - u, value - height
    normal = np.array([slope, np.ones(count)]) / np.hypot(1, slope)
    sigma = np.median(np.hypot(problem.points[SIGMA_X], problem.points[SIGMA_Y]))
    points = rotation @ np.array([along, across]) + p[at.indices("dx", "dy")][:, None]
    return np.vstack([points, sigma * (rotation @ normal)])
