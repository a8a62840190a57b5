"""Paper's 2D-VBAA (section V-A): the mean contact of all pairs of points.

The method uses linear theory on the calibration plane or, if the rig states the inclination of the
deformation plane, on that plane: the points are un-projected first by (7) and (8). For two points
x1 < x2 the ratio rho = y2 / y1 determines x_c: it grows strictly from x2/x1 (contact at the clamp)
to (x2/x1)^2 (contact at infinity), so a pair has one solution or none, and the paper's three cases
are three intervals of one function (`beams.linear.contact_of_pair`).

Corrections to the paper. The force follows from (9) or (10) at the first point; on the straight
part that equals (18) with the last factor of its denominator squared, which the print omits. The
root of (20) is taken in [x1, x2] alone; (24) has 2 x2 - x_c in its first bracket, and its
conclusion holds. "More than one candidate" is impossible, with or without noise: noise makes pairs
without a solution. (11) neglects the force's component along the beam, so that the force is 4 % too
low where the beam has turned by 17 degrees; that is the paper's approximation and is kept.

The rule, fixed before any scoring: all pairs of image columns with x2 - x1 >= L / 4 are used; pairs
without a solution, or with one beyond the beam's tip, are invalid; the estimate is the plain mean
of the valid ones (the paper: "more than 500 data"). A beam that is straight within its noise is no
contact, as the paper first detects contact from the shape. The estimate is biased where the beam
leaves linear theory: +0.9 to +5 % of L at 20 % deflection. The covariance is that of the noise, the
clamp and the rig's tolerances; it does not include this bias.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from solver.baselines.linear_estimate import (
    LinearContact,
    errors_of_planar_fit,
    estimate_from_linear_fit,
    planar_bend,
)
from solver.beams.linear import contact_of_pair, ratio_slope, unit_slope
from solver.instrument.arrays import Floats
from solver.instrument.compiled import njit
from solver.instrument.estimate import Estimate, Outcome
from solver.instrument.measurement import Measurement

MIN_PAIRS = 500
MIN_POINTS = 33  # fewer points cannot make 500 pairs
MIN_SEPARATION = 0.25  # of the beam's length


def two_point(measurement: Measurement) -> Estimate:
    """Estimate contact distance x_c, force f and derived values, with their joint covariance."""
    prepared = planar_bend(measurement, MIN_POINTS)
    if isinstance(prepared, Estimate):
        return prepared
    planar, bend = prepared
    mean = mean_of_pairs(planar)
    if isinstance(mean, Estimate):
        return mean
    covariance = errors_of_planar_fit(planar, mean.noise * bend.variance_inflation, mean.by_base)
    contact = LinearContact(mean.x_c, mean.load, covariance)
    return estimate_from_linear_fit(contact, planar, f"mean of {mean.pairs} pairs")


@dataclass(frozen=True)
class MeanOfPairs:
    """Mean x_c [m] and load f / (6 EI) [1/m^2] of `pairs` valid pairs of points.

    `rows` (n,) are the points' indices in the measurement, `by_point` (2, n) the derivative of
    x_c and load by their y, `slope` (n,) the mean beam's slope there, `noise` (2, 2) the
    covariance due to the points' errors, `by_base` (2, 3) the derivative by the clamp's true
    (dx, dy, tilt).
    """

    x_c: float
    load: float
    pairs: int
    rows: npt.NDArray[np.int64]
    by_point: Floats
    slope: Floats
    noise: Floats
    by_base: Floats

    def moved(self, steps: Floats) -> Floats:
        """Compute the change (2,) of x_c and load if the points `rows` move by `steps` (n, 2)."""
        return np.asarray(self.by_point @ (steps[:, 1] - self.slope * steps[:, 0]))


def mean_of_pairs(planar: Measurement) -> MeanOfPairs | Estimate:
    """Average over all valid pairs of points on the deformation plane, by the rule above."""
    length = planar.rig.beam.length
    ahead = np.flatnonzero(planar.points[:, 0] > 0)
    rows = ahead[np.argsort(planar.points[ahead, 0], kind="stable")]
    x, y = planar.points[rows].T
    sums, by_point, tried = _sum_over_pairs(x, y, MIN_SEPARATION * length, length)
    pairs = int(sums[0])
    if tried < MIN_PAIRS:
        return Estimate(
            Outcome.NOT_IDENTIFIABLE,
            f"{tried} pairs of points are far enough apart, needed are {MIN_PAIRS}",
        )
    if pairs < MIN_PAIRS:
        return Estimate(
            Outcome.INVALID,
            f"{pairs} of {tried} pairs of points fit a point contact, needed are {MIN_PAIRS}",
        )
    x_c, load = float(sums[1]) / pairs, float(sums[2]) / pairs
    # The pairs share points, so the scatter of pairs does not measure the mean's error: the
    # points' own errors are propagated instead, by d(mean)/d(y_i), pair by pair. An error along
    # the beam, of a point or of the clamp, shifts the beam across by its slope there.
    by_point /= pairs
    slope = load * unit_slope(x, x_c)
    along, across = planar.total_sigma_vectors[rows].T
    by_error = by_point * (across - slope * along)
    by_base = np.column_stack([-by_point @ slope, by_point.sum(axis=1), by_point @ x])
    noise = by_error @ by_error.T
    return MeanOfPairs(x_c, load, pairs, rows, by_point, slope, noise, by_base)


def contact_distance(x1: Floats, y1: Floats, x2: Floats, y2: Floats) -> Floats:
    """Compute x_c (n,) [m] from pairs of points, 0 < x1 < x2; NaN for a pair without a solution."""
    return np.asarray(_contacts(x1, y1, x2, y2))


@njit
def _contacts(x1: Floats, y1: Floats, x2: Floats, y2: Floats) -> Floats:
    x_c = np.full(len(x1), np.nan)
    for i in range(len(x1)):
        if y1[i] > 0:
            c = contact_of_pair(x1[i], y1[i], x2[i], y2[i], 0.0)
            if 0 < c < np.inf:
                x_c[i] = c
    return x_c


@njit
def _sum_over_pairs(
    x: Floats, y: Floats, separation: float, farthest: float
) -> tuple[Floats, Floats, int]:
    """Sum (valid pairs, x_c, load) over pairs; also derivatives by y (2, n) and pairs tried.

    `x` (n,) is in rising order. The contact of one pair is the guess for the next.
    """
    n = len(x)
    sums, by_point = np.zeros(3), np.zeros((2, n))
    tried, start = 0, 0
    for i in range(n):
        x1, y1 = x[i], y[i]
        while start < n and x[start] - x1 < separation:
            start += 1
        tried += n - start
        if y1 <= 0:
            continue
        c, inverse_y1 = 0.0, 1 / y1
        for j in range(start, n):
            x2, y2 = x[j], y[j]
            found = contact_of_pair(x1, y1, x2, y2, c)
            if not 0 < found <= farthest:
                continue
            c = found
            if x1 <= c:  # (9) at the first point
                unit, unit_by_c = (3 * c - x1) * x1**2, 3 * x1**2
            else:  # (10)
                unit, unit_by_c = (3 * x1 - c) * c**2, (6 * x1 - 3 * c) * c
            inverse_unit = 1 / unit
            load = y1 * inverse_unit
            # The implicit function rho(x_c) = y2 / y1.
            c_by_2 = 1 / (y1 * ratio_slope(x1, x2, c))
            c_by_1 = -c_by_2 * y2 * inverse_y1
            load_by_c = -load * unit_by_c * inverse_unit
            sums[0] += 1
            sums[1] += c
            sums[2] += load
            by_point[0, i] += c_by_1
            by_point[0, j] += c_by_2
            by_point[1, i] += inverse_unit + load_by_c * c_by_1
            by_point[1, j] += load_by_c * c_by_2
    return sums, by_point, tried
