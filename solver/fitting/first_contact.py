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

from solver.fitting.correlation import integrated_correlation
from solver.instrument.arrays import Floats, Mask
from solver.instrument.compiled import njit
from solver.instrument.dot_products import dot
from solver.instrument.estimate import Estimate, Outcome
from solver.instrument.measurement import Measurement
from solver.instrument.small_matrices import solve_definite

# Least significance of a bend, in sigmas; noise exceeds it about once in a million frames.
LEAST_SIGNIFICANCE = 5.0
# Number of contact distances on the grid, evenly spaced up to the tip.
DISTANCES = 50
LEAST_POINTS = 4
STEPS = 3


@dataclass(frozen=True)
class Bend:
    """Nearest linear beam: x_c [m], amplitude f / (6 EI) [1/m^2], and the latter over its sigma.

    `offset` [m] and `tilt` [rad] are the clamp's, estimated from their prior and the points. The
    points' variances must be multiplied by the variance inflation `widening`: the correlation
    length, times the misfit where that is larger than the sigmas allow.
    """

    x_c: float
    amplitude: float
    significance: float
    offset: float = 0.0
    tilt: float = 0.0
    widening: float = 1.0

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
    chosen = ... if kept is None else kept
    points = np.array(measurement.points[chosen])
    sigma_vectors = np.array(measurement.sigma_vectors[chosen])
    if (points[1:, 0] < points[:-1, 0]).any():  # correlated neighbours must be adjacent
        order = np.argsort(points[:, 0], kind="stable")
        points, sigma_vectors = points[order], sigma_vectors[order]
    if len(points) < LEAST_POINTS:
        return Bend(length, 0.0, 0.0)
    return Bend(*_nearest(points, sigma_vectors, measurement.base_covariance, length))


def no_contact(bend: Bend) -> Estimate | None:
    """Return an Estimate if there is no bend, or one to the side without object; else None."""
    if abs(bend.significance) < LEAST_SIGNIFICANCE:
        return Estimate(Outcome.NO_CONTACT, f"a bend of {abs(bend.significance):.1f} sigmas")
    if bend.significance < 0:
        return Estimate(Outcome.INVALID, "the beam bends to the side where the rig has no object")
    return None


@njit
def _nearest(
    points: Floats, sigma_vectors: Floats, base_covariance: Floats, length: float
) -> tuple[float, float, float, float, float, float]:
    """Compute the fields of `Bend`."""
    turn, x, y, sigma, base = _in_own_direction(points, sigma_vectors, base_covariance, length)
    moments = _moments(x, y, sigma)
    determinant = base[0, 0] * base[1, 1] - base[0, 1] ** 2
    prior = np.empty((2, 2))
    prior[0, 0], prior[1, 1] = base[1, 1] / determinant, base[0, 0] / determinant
    prior[0, 1] = prior[1, 0] = -base[0, 1] / determinant
    best = _largest(moments, prior, -turn, 1.0)
    refined, residual = _refined(x, y, sigma, best, prior, -turn)
    misfit = max(dot(residual, residual) / max(len(x) - 2, 1), 1.0)
    widening = misfit * integrated_correlation(residual)
    if widening > 1:
        k = best[0]
        best = _largest(moments, prior, -turn, widening)
        if best[0] != k:
            refined, _ = _refined(x, y, sigma, best, prior * widening, -turn)
    x_c, amplitude, offset, tilt = refined
    significance = math.copysign(best[2], amplitude) if amplitude != 0 else 0.0
    tilt = turn + math.atan(tilt)
    return x_c * length, amplitude / length**2, significance, offset * length, tilt, widening


@njit
def _in_own_direction(
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
    line = math.atan2(sxy, sxx)
    open_tilt = base_covariance[2, 2]
    turn = line * open_tilt / (open_tilt + (line / 10) ** 2)
    cosine, sine = math.cos(turn), math.sin(turn)
    x, y, sigma = np.empty(n), np.empty(n), np.empty(n)
    for i in range(n):
        px, py = points[i, 0] / length, points[i, 1] / length
        x[i] = max(cosine * px + sine * py, 0.0)
        y[i] = cosine * py - sine * px
        along, across = sigma_vectors[i, 0], sigma_vectors[i, 1]
        size = math.hypot(along, across) / length
        # An error along the beam is not observable; 1 nm per metre keeps weights finite.
        sigma[i] = max(abs(cosine * across - sine * along) / length, 1e-3 * size, 1e-9)
    offset = (
        sine * sine * base_covariance[0, 0]
        - 2 * sine * cosine * base_covariance[0, 1]
        + cosine * cosine * base_covariance[1, 1]
    ) / length**2
    both = (cosine * base_covariance[1, 2] - sine * base_covariance[0, 2]) / length
    base = np.array([[offset, both], [both, open_tilt]])
    base[0, 0] += 1e-20
    base[1, 1] += 1e-20
    return turn, x, y, sigma, base


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
def _largest(
    moments: Floats, prior: Floats, tilt: float, widening: float
) -> tuple[int, float, float, float, float]:
    """Find the most significant bend on the grid of contact distances.

    Returns the index of its contact distance, its amplitude, significance, offset and tilt.
    `prior` (2, 2) is the inverse covariance of offset and tilt about (0, `tilt`).
    """
    everything = moments[DISTANCES] / widening
    n11 = everything[0] + prior[0, 0]
    n12 = everything[1] + prior[0, 1]
    n22 = everything[2] + prior[1, 1]
    r1 = everything[7] + prior[0, 1] * tilt
    r2 = everything[8] + prior[1, 1] * tilt
    determinant = n11 * n22 - n12 * n12
    best, amplitude, significance, offset, slope = 0, 0.0, 0.0, 0.0, 0.0
    for k in range(DISTANCES):
        c = (k + 1) / DISTANCES
        near = moments[k] / widening
        far = everything - near
        uu = (9 * c * near[4] - 6 * near[5]) * c + near[6]
        uu += ((9 * far[2] - 6 * c * far[1]) + c * c * far[0]) * c**4
        u1 = 3 * c * near[2] - near[3] + (3 * far[1] - c * far[0]) * c**2
        ux = 3 * c * near[3] - near[4] + (3 * far[2] - c * far[1]) * c**2
        uy = 3 * c * near[9] - near[10] + (3 * far[8] - c * far[7]) * c**2
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
def _refined(
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
    weight = 1 / sigma
    rows, normal, right = np.empty((4, len(x))), np.empty((4, 4)), np.empty(4)
    rows[2], rows[3] = weight, x * weight
    kept, kept_residual, least = (x_c, amplitude, offset, tilt), np.zeros(len(x)), np.inf
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
        squares = dot(residual, residual)
        turned = tilt - resting_tilt
        squares += prior[0, 0] * offset**2 + 2 * prior[0, 1] * offset * turned
        squares += prior[1, 1] * turned**2
        if not squares < least:
            break
        kept, kept_residual, least = (x_c, amplitude, offset, tilt), residual, squares
        for p in range(4):
            right[p] = dot(rows[p], residual)
            for q in range(p + 1):
                normal[p, q] = normal[q, p] = dot(rows[p], rows[q])
        for p in range(2):
            right[2 + p] -= prior[p, 0] * offset + prior[p, 1] * turned
            for q in range(2):
                normal[2 + p, 2 + q] += prior[p, q]
        for p in range(4):
            normal[p, p] *= 1 + 1e-12
        # Cholesky's errors do not depend on the units of the columns (Higham 2002, theorem 10.6).
        if not solve_definite(normal, right):  # no deflection to refine
            break
        # Limit the step: at most half the way to the clamp, x_c at most 1.5 beam lengths.
        nearest = min(max(x_c + right[1], x_c / 2), 1.5)
        part = (nearest - x_c) / right[1] if right[1] != 0 else 1.0
        amplitude += part * right[0]
        x_c = nearest
        offset += part * right[2]
        tilt += part * right[3]
    return kept, kept_residual
