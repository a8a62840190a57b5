"""Contact from the curvature of a spline, as laboratories estimate it for whiskers.

A smoothing spline through the measured points gives the curvature at the base; times the flexural
rigidity it is the bending moment M0 (Birdwell et al. 2007, J. Neurophysiol. 98; Pammer et al. 2013,
J. Neurosci. 33). Moment and slope give force and contact distance (Solomon and Hartmann 2006,
Nature 443), here for deflections of any size. Beyond the contact the beam is straight, with the
slope theta_c. A contact without friction pushes at a right angle to the beam, so that

- bending energy at the base, EI kappa0^2 / 2 = F sin(theta_c), gives the force F;
- the moment at the base, EI kappa0 = F (x_c cos(theta_c) + y_c sin(theta_c)), gives x_c on the
  curve. For small deflections it is x_c = 2 theta_c / kappa0.

The plane is C, the clamp is at the origin, and no covariance is stated. It runs as it is:

    vbaa-bench suite run 1.0 --track lite --submission docs/entrants/spline_curvature
"""

import math

import numpy as np
from scipy.interpolate import UnivariateSpline
from scipy.optimize import brentq

from solver import Estimate, Measurement, Outcome

# Points fewer than this do not determine a cubic spline with noise. Chosen.
MIN_POINTS = 20
# A bend below this many standard errors of the tip's deflection is none. Chosen: 5 sigma.
MIN_SIGMAS = 5.0
# Share of the visible length, at its end, whose slope starts the search. Chosen: a fifth.
END = 0.2


def estimate(measurement: Measurement) -> Estimate:
    """Estimate x_c and force from the curvature at the base and the slope beyond the contact."""
    length, rigidity = measurement.rig.beam.length, measurement.rig.beam.flexural_rigidity
    ahead = measurement.points[:, 0] > 0.02 * length
    x, y = measurement.points[ahead].T
    sigma = np.linalg.norm(measurement.total_sigma_vectors[ahead], axis=1)
    x, rows = np.unique(x, return_index=True)
    y, sigma = y[rows], sigma[rows]
    if len(x) < MIN_POINTS:
        return Estimate(Outcome.NOT_IDENTIFIABLE, f"{len(x)} points, needed are {MIN_POINTS}")
    # y / x^2 is linear up to the contact in linear theory, and its spline obeys the clamp,
    # y(0) = y'(0) = 0. Weights are inverse sigmas, so the residual is to be the number of points.
    spline = UnivariateSpline(x, y / x**2, w=x**2 / sigma, k=3, s=len(x))
    curvature = 2 * float(spline(0.0))
    bend = float(np.median(y[-5:]))
    if abs(bend) < MIN_SIGMAS * math.sqrt(
        float(np.median(sigma)) ** 2 / 5 + measurement.base_covariance[1, 1]
    ):
        return Estimate(Outcome.NO_CONTACT)
    x_c = x[-1] - END * (x[-1] - x[0])
    for _ in range(5):  # the slope needs the contact, and the contact the slope
        theta_c = _slope(x, y, sigma, min(x_c, x[-MIN_POINTS // 2]))
        if not 0 < theta_c < math.pi / 2 or curvature <= 0:
            return Estimate(Outcome.INVALID, "the beam does not bend to one side")
        arm = 2 * math.sin(theta_c) / curvature

        def excess(place: float, theta_c: float = theta_c, arm: float = arm) -> float:
            deflection = place**2 * float(spline(place))
            return place * math.cos(theta_c) + deflection * math.sin(theta_c) - arm

        if excess(length) <= 0:
            return Estimate(Outcome.INVALID, "the contact would be beyond the tip")
        x_c = float(brentq(excess, 0.0, length))
    force = rigidity * curvature**2 / (2 * math.sin(theta_c))
    return Estimate(Outcome.CONTACT, values={"x_c_m": x_c, "force_n": force})


def _slope(x: np.ndarray, y: np.ndarray, sigma: np.ndarray, start: float) -> float:
    """Fit the angle [rad] of the straight part of the beam, from `start` [m] on."""
    straight = x >= start
    gradient, _ = np.polyfit(x[straight], y[straight], 1, w=1 / sigma[straight])
    return math.atan(float(gradient))


estimate.information = "planar"  # type: ignore[attr-defined]
