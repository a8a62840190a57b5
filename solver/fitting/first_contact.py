"""Detect first contact from one frame.

The test is whether the beam is bent, not whether it has left its rest position. For each contact
distance of a grid, the amplitude of the linear beam is estimated by generalised least squares
(Aitken 1935) together with the clamp's offset and tilt, which have the measurement's prior. If the
clamp's pose is known to micrometres, the whole deflection counts as bend. If its tilt is unknown,
as with a camera fixed in the world, only the curvature counts, and a straight line at any angle is
no contact.

The points' variances are multiplied by the correlation length of the residuals and by the misfit
where that is larger than the sigmas allow. The significance is the largest ratio on the grid of
the amplitude to its sigma. Without contact it is the maximum of a few nearly independent normal
variables, so that it exceeds five sigmas about once in a million frames.
"""

import math
from dataclasses import dataclass

import numpy as np

from solver.core.correlation import integrated_correlation
from solver.core.thresholds import THRESHOLDS
from solver.instrument.arrays import Floats, Mask
from solver.instrument.compiled import njit
from solver.instrument.estimate import Assumption, Estimate, Outcome
from solver.instrument.measurement import Measurement
from solver.instrument.small_matrices import dot, solve_definite

# Number of contact distances on the grid, evenly spaced up to the tip.
DISTANCES = 50
STEPS = 3


@dataclass(frozen=True)
class Bend:
    """Nearest linear beam: x_c [m], amplitude f / (6 EI) [1/m^2], and the latter over its sigma.

    `offset` [m] and `tilt` [rad] are the clamp's, estimated from their prior and the points. The
    points' variances must be multiplied by `variance_inflation`: the correlation
    length, times the misfit where that is larger than the sigmas allow.
    """

    x_c: float
    amplitude: float
    significance: float
    offset: float = 0.0
    tilt: float = 0.0
    variance_inflation: float = 1.0

    @property
    def sigma(self) -> float:
        """Sigma of the amplitude [1/m^2], at this contact distance."""
        return self.amplitude / self.significance if self.significance else math.inf


def nearest_linear_bend(measurement: Measurement, kept: Mask | None = None) -> Bend:
    """Estimate the bend of largest significance, of either sign; zero below four points.

    Points (n,) of the measurement that are not `kept` are ignored.
    """
    length = measurement.rig.beam.length
    # numba compiles anew for arrays that cannot be written to, so both branches make copies.
    selection = ... if kept is None else kept
    points = np.array(measurement.points[selection])
    sigma_vectors = np.array(measurement.sigma_vectors[selection])
    if (points[1:, 0] < points[:-1, 0]).any():  # correlated neighbours must be adjacent
        order = np.argsort(points[:, 0], kind="stable")
        points, sigma_vectors = points[order], sigma_vectors[order]
    if len(points) < THRESHOLDS.min_bend_points:
        return Bend(length, 0.0, 0.0)
    return Bend(*_fit_bend(points, sigma_vectors, measurement.base_covariance, length))


def no_contact(bend: Bend) -> Estimate | None:
    """Return an Estimate if there is no bend, or one to the side without object; else None."""
    if abs(bend.significance) < THRESHOLDS.contact_sigmas:
        return Estimate(Outcome.NO_CONTACT, f"bend of {abs(bend.significance):.1f} sigmas")
    if bend.significance < 0:
        return Estimate(
            Outcome.INVALID,
            "the deflection opposes beam.deflects_towards of rig.json: check its sign; or the "
            "images are mirrored",
            assumption=Assumption.SIDE,
        )
    return None


@njit
def _fit_bend(
    points: Floats, sigma_vectors: Floats, base_covariance: Floats, length: float
) -> tuple[float, float, float, float, float, float]:
    """Compute the fields of `Bend`."""
    rotation, x, y, sigma, base = _rotate_to_beam(points, sigma_vectors, base_covariance, length)
    moments = _moments(x, y, sigma)
    determinant = base[0, 0] * base[1, 1] - base[0, 1] ** 2
    prior = np.empty((2, 2))
    prior[0, 0], prior[1, 1] = base[1, 1] / determinant, base[0, 0] / determinant
    prior[0, 1] = prior[1, 0] = -base[0, 1] / determinant
    best = _most_significant(moments, prior, -rotation, 1.0)
    refined, residual = _refine(x, y, sigma, best, prior, -rotation)
    misfit = max(dot(residual, residual) / max(len(x) - 2, 1), 1.0)
    variance_inflation = misfit * integrated_correlation(residual)
    if variance_inflation > 1:
        k = best[0]
        best = _most_significant(moments, prior, -rotation, variance_inflation)
        if best[0] != k:
            refined, _ = _refine(x, y, sigma, best, prior * variance_inflation, -rotation)
    x_c, amplitude, offset, tilt = refined
    significance = math.copysign(best[2], amplitude) if amplitude != 0 else 0.0
    tilt = rotation + math.atan(tilt)
    return (
        x_c * length,
        amplitude / length**2,
        significance,
        offset * length,
        tilt,
        variance_inflation,
    )


@njit
def _rotate_to_beam(
    points: Floats, sigma_vectors: Floats, base_covariance: Floats, length: float
) -> tuple[float, Floats, Floats, Floats, Floats]:
    """Express the points in beam lengths, in a frame rotated towards the beam's mean direction.

    The rotation depends on the uncertainty of the clamp's tilt: it is nearly full where ten sigmas
    of the tilt far exceed the beam's direction, zero where the tilt is known; the linear fit
    estimates the rest. Returns the angle, x, y, the sigmas across, and the covariance (2, 2) of
    the clamp's offset and tilt.
    """
    n = len(points)
    sx = sy = sxx = sxy = 0.0
    for i in range(n):
        sx += points[i, 0]
        sy += points[i, 1]
    sx, sy = sx / n, sy / n
    for i in range(n):
        dx, dy = points[i, 0] - sx, points[i, 1] - sy
        sxx += dx * dx
        sxy += dx * dy
    direction = math.atan2(sxy, sxx)
    tilt_variance = base_covariance[2, 2]
    rotation = direction * tilt_variance / (tilt_variance + (direction / 10) ** 2)
    cosine, sine = math.cos(rotation), math.sin(rotation)
    x, y, sigma = np.empty(n), np.empty(n), np.empty(n)
    for i in range(n):
        px, py = points[i, 0] / length, points[i, 1] / length
        x[i] = max(cosine * px + sine * py, 0.0)
        y[i] = cosine * py - sine * px
        along, across = sigma_vectors[i, 0], sigma_vectors[i, 1]
        sigma_norm = math.hypot(along, across) / length
        # An error along the beam is not observable; 1 nm per metre keeps weights finite.
        sigma[i] = max(abs(cosine * across - sine * along) / length, 1e-3 * sigma_norm, 1e-9)
    offset = (
        sine * sine * base_covariance[0, 0]
        - 2 * sine * cosine * base_covariance[0, 1]
        + cosine * cosine * base_covariance[1, 1]
    ) / length**2
    cross = (cosine * base_covariance[1, 2] - sine * base_covariance[0, 2]) / length
    base = np.array([[offset, cross], [cross, tilt_variance]])
    base[0, 0] += 1e-20
    base[1, 1] += 1e-20
    return rotation, x, y, sigma, base


@njit
def _moments(x: Floats, y: Floats, sigma: Floats) -> Floats:
    """Sum weighted x^0 ... x^6, y x^0 ... y x^3 over the points up to each contact distance.

    The last row is the sum over all points. The deflection is a polynomial of the distance on
    either side of the contact, so a fit needs only these sums.
    """
    moments = np.zeros((DISTANCES + 1, 11))
    for i in range(len(x)):
        j = min(max(math.ceil(x[i] * DISTANCES) - 1, 0), DISTANCES)
        power = 1 / sigma[i] ** 2
        for k in range(7):
            moments[j, k] += power
            if k < 4:
                moments[j, 7 + k] += power * y[i]
            power *= x[i]
    for j in range(DISTANCES):
        for k in range(11):
            moments[j + 1, k] += moments[j, k]
    return moments


@njit
def _most_significant(
    moments: Floats, prior: Floats, tilt: float, variance_inflation: float
) -> tuple[int, float, float, float, float]:
    """Find the most significant bend on the grid of contact distances.

    Returns the index of its contact distance, its amplitude, significance, offset and tilt.
    `prior` (2, 2) is the inverse covariance of offset and tilt about (0, `tilt`).
    """
    total = moments[DISTANCES] / variance_inflation
    n11 = total[0] + prior[0, 0]
    n12 = total[1] + prior[0, 1]
    n22 = total[2] + prior[1, 1]
    r1 = total[7] + prior[0, 1] * tilt
    r2 = total[8] + prior[1, 1] * tilt
    determinant = n11 * n22 - n12 * n12
    best, amplitude, significance, offset, slope = 0, 0.0, 0.0, 0.0, 0.0
    for k in range(DISTANCES):
        c = (k + 1) / DISTANCES
        before = moments[k] / variance_inflation
        beyond = total - before
        uu = (9 * c * before[4] - 6 * before[5]) * c + before[6]
        uu += ((9 * beyond[2] - 6 * c * beyond[1]) + c * c * beyond[0]) * c**4
        u1 = 3 * c * before[2] - before[3] + (3 * beyond[1] - c * beyond[0]) * c**2
        ux = 3 * c * before[3] - before[4] + (3 * beyond[2] - c * beyond[1]) * c**2
        uy = 3 * c * before[9] - before[10] + (3 * beyond[8] - c * beyond[7]) * c**2
        # Eliminate the clamp's offset and tilt (Schur complement).
        w1 = (n22 * u1 - n12 * ux) / determinant
        w2 = (n11 * ux - n12 * u1) / determinant
        information = uu - w1 * u1 - w2 * ux
        if information <= 1e-12 * uu:  # this bend is indistinguishable from a tilted clamp
            continue
        score = uy - w1 * r1 - w2 * r2
        if abs(score) > abs(significance) * math.sqrt(information):
            best, amplitude = k, score / information
            significance = score / math.sqrt(information)
            b1, b2 = r1 - amplitude * u1, r2 - amplitude * ux
            offset = (n22 * b1 - n12 * b2) / determinant
            slope = (n11 * b2 - n12 * b1) / determinant
    return best, amplitude, significance, offset, slope


@njit
def _refine(
    x: Floats,
    y: Floats,
    sigma: Floats,
    best: tuple[int, float, float, float, float],
    prior: Floats,
    resting_tilt: float,
) -> tuple[tuple[float, float, float, float], Floats]:
    """Refine (x_c, amplitude, offset, tilt) between grid distances; return them and the residuals.

    A few Gauss-Newton steps remove the error of the coarse grid, so that the residuals, in sigmas,
    contain only the points' noise.
    """
    k, amplitude, _, offset, tilt = best
    x_c = (k + 1) / DISTANCES
    rows, normal, rhs = np.empty((4, len(x))), np.empty((4, 4)), np.empty(4)
    for i in range(len(x)):
        rows[2, i], rows[3, i] = 1 / sigma[i], x[i] / sigma[i]
    weight = rows[2]
    minimum, min_residual, min_cost = (x_c, amplitude, offset, tilt), np.zeros(len(x)), np.inf
    for _ in range(STEPS + 1):
        residual = np.empty(len(x))
        for i in range(len(x)):
            if x[i] <= x_c:
                u, by_x_c = (3 * x_c - x[i]) * x[i] ** 2, 3 * x[i] ** 2
            else:
                u, by_x_c = (3 * x[i] - x_c) * x_c**2, (6 * x[i] - 3 * x_c) * x_c
            residual[i] = (y[i] - amplitude * u - offset - tilt * x[i]) * weight[i]
            rows[0, i], rows[1, i] = u * weight[i], amplitude * by_x_c * weight[i]
        # Without a clear bend a step in x_c is arbitrary: accept it only if it reduces the sum.
        cost = dot(residual, residual)
        tilt_change = tilt - resting_tilt
        cost += prior[0, 0] * offset**2 + 2 * prior[0, 1] * offset * tilt_change
        cost += prior[1, 1] * tilt_change**2
        if not cost < min_cost:
            break
        minimum, min_residual, min_cost = (x_c, amplitude, offset, tilt), residual, cost
        for p in range(4):
            rhs[p] = dot(rows[p], residual)
            for q in range(p + 1):
                normal[p, q] = normal[q, p] = dot(rows[p], rows[q])
        for p in range(2):
            rhs[2 + p] -= prior[p, 0] * offset + prior[p, 1] * tilt_change
            for q in range(2):
                normal[2 + p, 2 + q] += prior[p, q]
        for p in range(4):
            normal[p, p] *= 1 + 1e-12
        # Cholesky's errors do not depend on the units of the columns (Higham 2002, theorem 10.6).
        if not solve_definite(normal, rhs):  # no deflection to refine
            break
        # Limit the step: at most half the way to the clamp, x_c at most 1.5 beam lengths.
        next_x_c = min(max(x_c + rhs[1], x_c / 2), 1.5)
        fraction = (next_x_c - x_c) / rhs[1] if rhs[1] != 0 else 1.0
        amplitude += fraction * rhs[0]
        x_c = next_x_c
        offset += fraction * rhs[2]
        tilt += fraction * rhs[3]
    return minimum, min_residual
