"""Contact and force from the consistency of a discretised beam, as published for wires.

Chen, Shan, Bretl and Pham, "Estimating force interactions of deformable linear objects from their
shapes" (arXiv 2602.01085, 2026), divide a wire into pieces. Pieces belong to one section, which
nothing touches, if they are consistent with one force F: with the edge e_i of piece i, and the
difference c_i of the bending moments at its ends, e_i x F = -c_i. Where F changes there is an
external force, and its place follows from its moment, if it exerts no torque.

Written from the text of the paper for one view of an antenna, with three changes. The shape is
known from one image because the beam bends in plane C. The free end is a section with F = 0. The
paper tests three neighbours with a manual threshold; here the sections are the two that are most
consistent with all moments and their covariance, since three neighbours are hidden in noise where
the beam bends little. It runs as it is:

    vbaa-bench suite run 1.0 --track lite --submission docs/entrants/consistent_sections
"""

import math
from typing import NamedTuple

import numpy as np
from scipy.interpolate import BSpline
from scipy.optimize import brentq

from solver import Estimate, Measurement, Outcome

# Pieces of the beam, as many as in the paper.
PIECES = 30
# Measured points per piece that a spline needs. Chosen.
MIN_POINTS = 4
# Nodes of a section that determine F and its moment.
MIN_NODES = 3
# Rounds: each moves a node to the contact of the previous one. Chosen.
ROUNDS = 3
# Standard errors of the moment at the clamp below which the beam is straight. Chosen.
MIN_SIGMAS = 5.0


class Rod(NamedTuple):
    """Nodes (n, 2) [m] of a discretised beam, their bending moments (n,) [N m], covariance."""

    nodes: np.ndarray
    moments: np.ndarray
    covariance: np.ndarray
    shape: BSpline


class Section(NamedTuple):
    """Force [N] on a section of the beam, its moment about the clamp [N m], and the misfit."""

    force_x: float
    force_y: float
    moment: float
    chi2: float


def estimate(measurement: Measurement) -> Estimate:
    """Estimate contact and force from the section between the clamp and the contact."""
    x_c = math.nan
    for _ in range(ROUNDS):
        rod = discretised(measurement, x_c)
        if rod is None:
            return Estimate(Outcome.NOT_IDENTIFIABLE, "too few points for the spline")
        if abs(rod.moments[0]) < MIN_SIGMAS * rod.covariance[0, 0] ** 0.5:
            return Estimate(Outcome.NO_CONTACT)
        sections = [section(rod, nodes) for nodes in range(MIN_NODES, PIECES + 1)]
        best = min(sections, key=lambda each: each.chi2)
        x_c = balanced(rod, best)
        if math.isnan(x_c):
            return Estimate(Outcome.INVALID, "the moment is balanced nowhere on the visible beam")
    force = float(np.hypot(best.force_x, best.force_y))
    return Estimate(Outcome.CONTACT, values={"x_c_m": x_c, "force_n": force, "f_n": best.force_y})


def discretised(measurement: Measurement, x_c: float) -> Rod | None:
    """Return the nodes and moments of a cubic spline with a clamped end; None for lack of points.

    Its second derivative is linear in each piece, as the moment is on both sides of the contact;
    therefore the node nearest to `x_c` [m] moves there, unless it is nan. Without its first two
    coefficients, a B-spline and its slope are zero at x = 0.
    """
    ahead = measurement.points[:, 0] > 0
    x, y = measurement.points[ahead].T
    sigma = np.linalg.norm(measurement.total_sigma_vectors[ahead], axis=1)
    if len(x) < MIN_POINTS * PIECES:
        return None
    # Pieces with equally many points: hidden parts of the beam do not leave a piece undetermined.
    knots = np.quantile(x, np.linspace(0, 1, PIECES + 1))
    knots[0] = 0
    if not math.isnan(x_c):
        knots[1 + abs(knots[1:-1] - x_c).argmin()] = x_c
    padded = np.pad(knots, 3, mode="edge")
    basis = BSpline(padded, np.eye(PIECES + 3)[:, 2:], 3)
    q, r = np.linalg.qr(basis(x) / sigma[:, None])
    inverse = np.linalg.inv(r)
    coefficients = inverse @ q.T @ (y / sigma)
    slope = basis.derivative(1)(knots) @ coefficients
    rigidity = measurement.rig.beam.flexural_rigidity
    bending = rigidity * basis.derivative(2)(knots) / (1 + slope[:, None] ** 2) ** 1.5
    return Rod(
        nodes=np.column_stack([knots, basis(knots) @ coefficients]),
        moments=bending @ coefficients,
        covariance=bending @ inverse @ inverse.T @ bending.T,
        shape=BSpline(padded, np.concatenate([[0.0, 0.0], coefficients]), 3),
    )


def section(rod: Rod, nodes: int) -> Section:
    """Fit one force to the first `nodes` nodes, and none to the others, by weighted least squares.

    The moment at a node is M - (x F_y - y F_x), where M is the moment of F about the clamp.
    """
    x, y = rod.nodes.T
    balance = np.column_stack([y, -x, np.ones(len(x))])
    balance[nodes:] = 0
    factor = np.linalg.cholesky(rod.covariance)
    whitened, target = np.linalg.solve(factor, balance), np.linalg.solve(factor, rod.moments)
    solution = np.linalg.lstsq(whitened, target)[0]
    force_x, force_y, moment = solution.tolist()
    return Section(force_x, force_y, moment, float(((target - whitened @ solution) ** 2).sum()))


def balanced(rod: Rod, section: Section) -> float:
    """Return x [m] of the point of the beam about which a force has no moment, or nan."""

    def excess(place: float) -> float:
        return float(place * section.force_y - rod.shape(place) * section.force_x - section.moment)

    end = rod.nodes[-1, 0]
    return math.nan if excess(0.0) * excess(end) > 0 else float(brentq(excess, 0.0, end))


estimate.information = "planar"  # type: ignore[attr-defined]
