"""Compute the votes of all point triples on the deformation plane's inclination: the mean of g_3D.

A triple's pairs (1, 2) and (1, 3) each give a contact by linear theory, w = x_c / (x_c + L); their
difference, averaged over all triples, is a weighted sum over pairs.
"""

from dataclasses import dataclass

import numpy as np

from solver.beams.linear import contact_of_pair, ratio_slope, unit_deflection, unit_slope
from solver.instrument.arrays import Floats
from solver.instrument.compiled import njit
from solver.instrument.measurement import Measurement
from solver.planes.plane_d import unproject

STRETCHES = 24
MIN_SEPARATION = 1 / 12  # of the beam's length, of neighbours in a triple


@dataclass(frozen=True)
class Nodes:
    """Points (k, 2) [m] on C, one per stretch, and the derivative (k, n) of their error.

    The derivative is by each measured point's error in its own sigmas, in the measurement's order.
    """

    points: Floats
    by_error: Floats


def stretch_nodes(measurement: Measurement) -> Nodes:
    """Fit a parabola to each of 24 stretches of equally many columns; return their middles."""
    usable = np.flatnonzero(measurement.points[:, 0] > 0)
    rows = usable[np.argsort(measurement.points[usable, 0], kind="stable")]
    points, by_error = (
        np.empty((STRETCHES, 2)),
        np.zeros((STRETCHES, len(measurement.points))),
    )
    for k, columns in enumerate(np.array_split(rows, STRETCHES)):
        x, y = measurement.points[columns].T
        middle = x.mean()
        t = (x - middle) / (np.ptp(x) or 1.0)
        # Repeated columns may leave fewer than three positions: use the parabola of least norm.
        pseudo = np.linalg.pinv(np.vander(t, 3, increasing=True))
        points[k] = middle, pseudo[0] @ y
        slope = pseudo[1] @ y / (np.ptp(x) or 1.0)
        along, across = measurement.total_sigma_vectors[columns].T
        by_error[k, columns] = pseudo[0] * (across - slope * along)
    return Nodes(points, by_error)


@dataclass(frozen=True)
class Votes:
    """Mean g as a weighted sum over pairs (k, k), and its derivative by the nodes' y (k,).

    `turned` (k,) [m] is the derivative by psi of the nodes' height over the beam.
    """

    weights: Floats
    by_node: Floats
    turned: Floats

    @staticmethod
    def at(
        nodes: Nodes,
        viewpoint: Floats,
        psi: float,
        x_c: float,
        load: float,
        length: float,
        weights: Floats | None = None,
    ) -> "Votes":
        """Compute the votes on a linear beam in the plane psi, with `weights` if given."""
        on_d, by_point, by_psi = unproject(nodes.points, viewpoint, psi)
        x = np.maximum(on_d[:, 0], 1e-6 * length)
        y, slope = load * unit_deflection(x, x_c), load * unit_slope(x, x_c)
        turned = by_psi[:, 1] - slope * by_psi[:, 0]
        sigma = np.linalg.norm(nodes.by_error, axis=1)
        sigma = sigma * np.abs(by_point[:, 1, 1] - slope * by_point[:, 0, 1])
        by_first, by_second = _by_pair(x, y, x_c, length)
        if weights is None:
            weights = _weights(
                x,
                turned,
                np.maximum(sigma, 1e-9 * length),
                (by_first, by_second),
                MIN_SEPARATION * length,
            )
        by_node = (weights * by_first).sum(axis=1) + (weights * by_second).sum(axis=0)
        return Votes(weights, by_node, turned)


def by_sources(
    nodes: Nodes,
    viewpoint: Floats,
    psi: float,
    x_c: float,
    load: float,
    length: float,
    weights: Floats,
    lifted: float | None = None,
) -> tuple[Floats, float]:
    """Compute dg / d(points' errors, clamp's dx, dy, tilt, psi) in the plane psi (n + 4,).

    `load` is that of the plane in which the height of the last node is `lifted` [m], or of this
    plane if that is None. The second result is the height in this plane.
    """
    on_d, by_point, _ = unproject(nodes.points, viewpoint, psi)
    height = float(on_d[-1, 1])
    if lifted is not None:
        load *= height / lifted
    votes = Votes.at(nodes, viewpoint, psi, x_c, load, length, weights)
    slope = load * unit_slope(on_d[:, 0], x_c)
    to_d = by_point[:, 1, 1] - slope * by_point[:, 0, 1]
    by_error = (votes.by_node * to_d) @ nodes.by_error
    by_base = votes.by_node @ np.column_stack([-slope, np.ones(STRETCHES), on_d[:, 0]])
    return np.concatenate([by_error, by_base, [votes.by_node @ votes.turned]]), height


@njit
def weighted_sum(x: Floats, y: Floats, weights: Floats, length: float) -> float:
    """Sum weight times w = x_c / (x_c + L) over pairs; NaN if a point is not lifted."""
    total = 0.0
    for i in range(len(x)):
        for j in range(i + 1, len(x)):
            if weights[i, j] != 0:
                if not (0 < x[i] < x[j] < np.inf) or y[i] <= 0 or y[j] <= 0:
                    return np.nan
                x_c = contact_of_pair(x[i], y[i], x[j], y[j], 0.0)
                total += weights[i, j] * (1.0 if x_c == np.inf else x_c / (x_c + length))
    return total


@njit
def _by_pair(x: Floats, y: Floats, x_c: float, length: float) -> tuple[Floats, Floats]:
    """Compute dw/dy of a pair's first and second point, (k, k) each, for y on a linear beam."""
    k = len(x)
    by_first, by_second = np.zeros((k, k)), np.zeros((k, k))
    for i in range(k):
        for j in range(i + 1, k):
            if x[j] > x[i]:
                slope = length / (x_c + length) ** 2 / (y[i] * ratio_slope(x[i], x[j], x_c))
                by_first[i, j], by_second[i, j] = -slope * y[j] / y[i], slope
    return by_first, by_second


@njit
def _weights(
    x: Floats,
    height_by_psi: Floats,
    sigma: Floats,
    by_pair: tuple[Floats, Floats],
    separation: float,
) -> Floats:
    """Compute the weight of every pair (k, k) in the mean of w12 - w13 over all triples."""
    by_first, by_second = by_pair
    k = len(x)
    weights, total = np.zeros((k, k)), 0.0
    for a in range(k):
        for b in range(a + 1, k):
            if x[b] - x[a] < separation:
                continue
            for c in range(b + 1, k):
                if x[c] - x[b] < separation:
                    continue
                by_a = by_first[a, b] - by_first[a, c]
                by_b, by_c = by_second[a, b], -by_second[a, c]
                noise = (by_a * sigma[a]) ** 2 + (by_b * sigma[b]) ** 2 + (by_c * sigma[c]) ** 2
                weight = (
                    by_a * height_by_psi[a] + by_b * height_by_psi[b] + by_c * height_by_psi[c]
                ) / noise
                weights[a, b] += weight
                weights[a, c] -= weight
                total += abs(weight)
    return weights / total if total > 0 else weights
