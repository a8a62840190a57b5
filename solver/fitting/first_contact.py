"""Has the beam touched anything? Detection of first contact, from one frame.

The question is whether the beam is bent, not whether it lies where it lay at rest. For each of a
grid of contact distances the amplitude of the linear beam is estimated by generalised least
squares (Aitken 1935) together with the clamp's offset and tilt, which have the prior that the
measurement states. A clamp known to micrometres leaves the whole deflection to the bend; one whose
tilt is not known at all, as before a camera that stands in the world, leaves only the curvature,
and a straight line at any angle is no contact.

The noise is taken as the points' sigmas, widened by the number of neighbours that err together
and by the misfit where that is larger than the sigmas allow. The largest of the grid's amplitudes
over its sigma is the significance. Under no contact it is the largest of a few nearly independent
normal variables, so that five sigmas are passed about once in a million frames.
"""

import math
from dataclasses import dataclass

import numpy as np

from solver.dot_products import dot
from solver.fitting.correlation import integrated_correlation
from solver.instrument.arrays import Floats, Mask
from solver.instrument.compiled import njit
from solver.instrument.estimate import Estimate, Outcome
from solver.instrument.measurement import Measurement

# A bend is believed from this many of its own sigmas on.
LEAST_SIGNIFICANCE = 5.0
# Contact distances that are tried, evenly up to the tip.
DISTANCES = 50
LEAST_POINTS = 4
STEPS = 3


@dataclass(frozen=True)
class Bend:
    """The nearest linear beam: x_c [m], f / (6 EI) [1/m^2], and the latter over its sigma.

    `offset` [m] and `tilt` [rad] are the clamp's, as far as their prior and the points tell. The
    points' variances are to be multiplied by `widening`: the number of neighbours that err
    together, times the misfit where that is larger than the sigmas allow.
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
    """The bend of largest significance, of either sign; none at all of fewer than four points.

    Of the measurement's points (n,) those that are not `kept` have no say.
    """
    length = measurement.rig.beam.length
    points, sigma_vectors = measurement.points, measurement.sigma_vectors
    if kept is not None:
        points, sigma_vectors = points[kept], sigma_vectors[kept]
    if len(points) < LEAST_POINTS:
        return Bend(length, 0.0, 0.0)
    return Bend(*_nearest(points, sigma_vectors, measurement.base_covariance, length))


def no_contact(bend: Bend) -> Estimate | None:
    """The answer where there is no bend, or one to the side without object; None where there is."""
    if abs(bend.significance) < LEAST_SIGNIFICANCE:
        return Estimate(Outcome.NO_CONTACT, f"a bend of {abs(bend.significance):.1f} sigmas")
    if bend.significance < 0:
        return Estimate(Outcome.INVALID, "the beam bends to the side where the rig has no object")
    return None


@njit(cache=True)
def _nearest(
    points: Floats, sigma_vectors: Floats, base_covariance: Floats, length: float
) -> tuple[float, float, float, float, float, float]:
    """What `Bend` holds."""
    turn, x, y, sigma, base = _in_own_direction(points, sigma_vectors, base_covariance, length)
    if (x[1:] < x[:-1]).any():  # neighbours that err together must stand together
        order = np.argsort(x)
        x, y, sigma = x[order], y[order], sigma[order]
    moments = _moments(x, y, sigma)
    prior = np.linalg.inv(base).astype(np.float64)
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


@njit(cache=True)
def _in_own_direction(
    points: Floats, sigma_vectors: Floats, base_covariance: Floats, length: float
) -> tuple[float, Floats, Floats, Floats, Floats]:
    """Points in lengths of the beam, in a frame turned into the beam's mean direction.

    It is turned as far as the clamp's tilt is open: fully where ten sigmas of it reach as far, not
    at all where the tilt is known; the rest is left to the linear fit. Gives the angle, x, y,
    the sigmas across, and the covariance (2, 2) of the clamp's offset and tilt.
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
        # An error along the beam cannot be seen; a nanometre on a metre keeps weights finite.
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


@njit(cache=True)
def _moments(x: Floats, y: Floats, sigma: Floats) -> Floats:
    """Weighted sums of x^0 ... x^6, y x^0 ... y x^3 over the points up to each contact distance.

    The last row holds all points. The deflection is a polynomial of the distance on either side
    of the contact, so these sums are all that a fit needs.
    """
    moments = np.zeros((DISTANCES + 1, 11))
    for i in range(len(x)):
        row = moments[min(max(math.ceil(x[i] * DISTANCES) - 1, 0), DISTANCES)]
        power = 1 / sigma[i] ** 2
        for k in range(7):
            row[k] += power
            if k < 4:
                row[7 + k] += power * y[i]
            power *= x[i]
    for j in range(DISTANCES):
        moments[j + 1] += moments[j]
    return moments


@njit(cache=True)
def _largest(
    moments: Floats, prior: Floats, tilt: float, widening: float
) -> tuple[int, float, float, float, float]:
    """Index of the contact distance, amplitude, significance, offset and tilt of the best bend.

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
        # The clamp's offset and tilt are taken out of the bend (Schur's complement).
        w1 = (n22 * u1 - n12 * ux) / determinant
        w2 = (n11 * ux - n12 * u1) / determinant
        information = uu - w1 * u1 - w2 * ux
        if information <= 1e-12 * uu:  # this bend cannot be told from a turned clamp
            continue
        score = uy - w1 * r1 - w2 * r2
        if abs(score) > abs(significance) * math.sqrt(information):
            best, amplitude = k, score / information
            significance = score / math.sqrt(information)
            b1, b2 = r1 - amplitude * u1, r2 - amplitude * ux
            offset = (n22 * b1 - n12 * b2) / determinant
            slope = (n11 * b2 - n12 * b1) / determinant
    return best, amplitude, significance, offset, slope


@njit(cache=True, error_model="numpy")
def _refined(
    x: Floats,
    y: Floats,
    sigma: Floats,
    best: tuple[int, float, float, float, float],
    prior: Floats,
    resting_tilt: float,
) -> tuple[tuple[float, float, float, float], Floats]:
    """(x_c, amplitude, offset, tilt) between the grid's distances, and the residuals in sigmas.

    A few Gauss-Newton steps: what is left of the points is then their noise, not the grid's
    coarseness.
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
        # Where there is no bend to speak of, a step in x_c may lead anywhere: it must pay.
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
        normal[2:, 2:] += prior
        for p in range(2):
            right[2 + p] -= prior[p, 0] * offset + prior[p, 1] * turned
        for p in range(4):
            normal[p, p] *= 1 + 1e-12
        if normal[0, 0] <= 0 or normal[1, 1] <= 0:  # no deflection at all: nothing to refine
            break
        # Columns are scaled to one, so that units do not decide how well this is solved.
        scale = np.sqrt(np.diag(normal))
        moved = np.linalg.solve(normal / np.outer(scale, scale), right / scale) / scale
        # Never by more than half the way to the clamp, never far beyond the tip.
        nearest = min(max(x_c + moved[1], x_c / 2), 1.5)
        part = (nearest - x_c) / moved[1] if moved[1] != 0 else 1.0
        amplitude += part * moved[0]
        x_c = nearest
        offset += part * moved[2]
        tilt += part * moved[3]
    return kept, kept_residual
