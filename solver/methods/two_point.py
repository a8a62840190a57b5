"""The paper's 2D-VBAA (section V-A): every pair of points gives a contact, the mean is the answer.

Linear theory. For two points x1 < x2 the ratio rho = y2 / y1 determines x_c: it grows strictly
from x2/x1 (contact at the clamp) to (x2/x1)^2 (contact at infinity), so a pair has one solution
or none, and the paper's three cases are three stretches of one function.

    both on the curved part (15)   x_c = (x1 + (x2 - x1) q1 / (q1 - q2)) / 3 with q = y / x^2
    both on the linear part (19)   x_c = 3 (x1 - y1 / m) with m = (y2 - y1) / (x2 - x1)
    one on each (20)               the root of the cubic in [x1, x2]

The force follows from (9) or (10) at the first point; on the linear part that equals (18) with
the last factor of its denominator squared, which the paper's print omits.

The rule, fixed before any scoring: all pairs of image columns with x2 - x1 >= L / 4; pairs
without a solution, or with one beyond the beam's tip, are invalid; the answer is the plain mean
of the valid ones (the paper: "more than 500 data"). A beam that is straight within its noise is no
contact, as the paper detects first contact from the shape before anything else. Biased where the
beam leaves linear theory: +0.9 to +5 % of L at 20 % deflection.
"""

import numpy as np

from solver.beam_models.linear import unit_deflection
from solver.fitting.first_contact import nearest_linear_bend, no_contact
from solver.instrument.arrays import Floats
from solver.instrument.estimate import Estimate, Outcome
from solver.instrument.measurement import Measurement

LEAST_PAIRS = 500
LEAST_POINTS = 33  # fewer cannot make so many pairs
LEAST_SEPARATION = 0.25  # of the beam's length


def two_point(measurement: Measurement) -> Estimate:
    """Contact distance x_c and force f, with the covariance that the points' noise gives them."""
    beam, tolerances = measurement.rig.beam, measurement.rig.tolerances
    if len(measurement.points) < LEAST_POINTS:
        return Estimate(
            Outcome.INVALID,
            f"{len(measurement.points)} visible points, needed are {LEAST_POINTS}",
        )
    refusal = no_contact(nearest_linear_bend(measurement))
    if refusal is not None:
        return refusal
    ahead = measurement.points[:, 0] > 0
    x, y = measurement.points[ahead].T
    first, second = np.nonzero(x[None, :] - x[:, None] >= LEAST_SEPARATION * beam.length)
    x_c = contact_distance(x[first], y[first], x[second], y[second])
    with np.errstate(invalid="ignore"):
        valid = (x_c > 0) & (x_c <= beam.length)
    pairs = int(valid.sum())
    if pairs < LEAST_PAIRS:
        return Estimate(
            Outcome.INVALID,
            f"{pairs} of {len(x_c)} pairs of points fit a point contact, needed are {LEAST_PAIRS}",
        )
    first, second, x_c = first[valid], second[valid], x_c[valid]
    ei = beam.flexural_rigidity
    force = 6 * ei * y[first] / unit_deflection(x[first], x_c)
    mean_x_c, mean_force = float(x_c.mean()), float(force.mean())

    # The pairs share their points, so the scatter of pairs says nothing about the mean: the
    # points' own errors are carried through instead, d(mean)/d(y_i), pair by pair.
    x_c_by_1, x_c_by_2 = _gradient(x[first], y[first], x[second], y[second], x_c)
    step = 1e-6 * x_c
    per_load = 1 / unit_deflection(x[first], x_c)
    per_load_by_x_c = (1 / unit_deflection(x[first], x_c + step) - per_load) / step
    force_by_x_c = 6 * ei * y[first] * per_load_by_x_c
    n = len(x)
    by_point = np.vstack(
        [
            np.bincount(first, x_c_by_1, n) + np.bincount(second, x_c_by_2, n),
            np.bincount(first, 6 * ei * per_load + force_by_x_c * x_c_by_1, n)
            + np.bincount(second, force_by_x_c * x_c_by_2, n),
        ]
    )
    by_point /= pairs
    sigma = measurement.sigma_vectors[ahead][:, 1]
    covariance = (by_point * sigma**2) @ by_point.T
    # A clamp displaced by dx along the beam shows each point where the beam is lower by y' dx.
    load = mean_force / (6 * ei)
    here, there = unit_deflection(x, mean_x_c), unit_deflection(x + 1e-6, mean_x_c)
    slope = load * (there - here) / 1e-6
    by_base = -np.column_stack([by_point @ slope, by_point.sum(axis=1), by_point @ x])
    covariance += by_base @ measurement.base_covariance @ by_base.T
    by_scale = np.array([mean_x_c, -2 * mean_force])
    covariance += np.outer(by_scale, by_scale) * measurement.scale_sigma**2
    covariance[1, 1] += (mean_force / ei * tolerances.flexural_rigidity) ** 2
    return Estimate(
        Outcome.CONTACT,
        f"mean of {pairs} pairs",
        values={"x_c_m": mean_x_c, "force_n": mean_force},
        covariance=covariance,
    )


def contact_distance(x1: Floats, y1: Floats, x2: Floats, y2: Floats) -> Floats:
    """x_c (n,) [m] from pairs of points with 0 < x1 < x2; NaN for a pair without a solution."""
    with np.errstate(divide="ignore", invalid="ignore"):
        rho, r = y2 / y1, x2 / x1
        solvable = (y1 > 0) & (rho > r) & (rho < r**2)
        # rho at x_c = x1 and at x_c = x2 separates the three cases.
        linear = solvable & (rho <= (3 * x2 - x1) / (2 * x1))
        curved = solvable & (rho >= 2 * x2**3 / ((3 * x2 - x1) * x1**2))
        mixed = solvable & ~linear & ~curved
        x_c = np.full(len(x1), np.nan)
        slope = (y2 - y1) / (x2 - x1)
        x_c[linear] = 3 * (x1 - y1 / slope)[linear]
        q1, q2 = y1 / x1**2, y2 / x2**2
        x_c[curved] = ((x1 + (x2 - x1) * q1 / (q1 - q2)) / 3)[curved]
    x_c[mixed] = _mixed_case(x1[mixed], x2[mixed], rho[mixed])
    return x_c


def _mixed_case(x1: Floats, x2: Floats, rho: Floats) -> Floats:
    """Eq. (20), c^3 - 3 x2 c^2 + 3 x1^2 rho c - x1^3 rho = 0 for the root c in [x1, x2].

    Newton's steps, each kept inside a bracket that shrinks around the root.
    """

    def cubic(c: Floats) -> Floats:
        return np.asarray(((c - 3 * x2) * c + 3 * x1**2 * rho) * c - x1**3 * rho)

    low, high = x1.copy(), x2.copy()
    c = (low + high) / 2
    for _ in range(60):
        value = cubic(c)
        positive = value > 0  # g falls from g(x1) >= 0 to g(x2) <= 0
        low, high = np.where(positive, c, low), np.where(positive, high, c)
        slope = 3 * c**2 - 6 * x2 * c + 3 * x1**2 * rho
        newton = c - value / np.where(slope == 0, 1.0, slope)
        inside = (newton > low) & (newton < high)
        following = np.where(inside, newton, (low + high) / 2)
        if np.all(np.abs(following - c) <= 1e-13 * x2):
            return following
        c = following
    return c


def _gradient(x1: Floats, y1: Floats, x2: Floats, y2: Floats, x_c: Floats) -> tuple[Floats, Floats]:
    """d x_c / d y1 and d x_c / d y2 [1] by the implicit function rho(x_c) = y2 / y1."""
    step = 1e-6 * x_c

    def rho(c: Floats) -> Floats:
        return unit_deflection(x2, c) / unit_deflection(x1, c)

    slope = (rho(x_c + step) - rho(x_c - step)) / (2 * step)
    return -y2 / y1**2 / slope, 1 / (y1 * slope)
