"""Paper's 3D-VBAA with a moment sensor (section V-C): one image and the moment at the base.

The image gives contact distance and force by pairs of points, as in section V-A; the sensor reads
the moment about y of the force out of the calibration plane. Their ratio gives the inclination psi
of the deformation plane.

Corrections to the paper. (27) is m_y = x_c f_z; for a right-handed moment that the beam exerts on
the sensor it is m_y = -x_c f_z. Its lever is x_c only to first order: a force normal to the beam,
which has turned by theta_c at the contact, has the lever x_c cos(theta_c) + y_c sin(theta_c),
1.2 % longer at x_c = 180 mm and 20 % deflection. "The deformation plane coincides with the
calibration plane" holds for a camera infinitely far away, and even then f and x_c differ from
those of the image on C. So the points are un-projected by (7) and (8) with

    psi = atan2(-m_y / lever, F cos(psi)),

iterated until convergence; F cos(psi) hardly depends on psi, so that the iteration contracts at any
inclination, whereas psi = arcsin(f_z / F) diverges above 45 degrees. Aitken's rule accelerates it
and step halving prevents overshooting. (28) and (29) give the displacement.

Pairs and their mean are those of `two_point`, with its bias. The covariance is that of the points'
noise, the sensor's noise, the clamp's pose and the rig's tolerances.
"""

import math

import numpy as np

from solver.baselines.linear_estimate import (
    ERRORS,
    LOAD,
    PSI,
    RIGIDITY,
    SCALE,
    X_C,
    LinearContact,
    errors_of_planar_fit,
    estimate_from_linear_fit,
)
from solver.baselines.two_point import MIN_POINTS, MeanOfPairs, mean_of_pairs
from solver.core.thresholds import THRESHOLDS
from solver.fitting.first_contact import nearest_linear_bend, no_contact
from solver.instrument.arrays import Floats
from solver.instrument.estimate import Estimate, Outcome
from solver.instrument.measurement import UNKNOWN_VIEWPOINT, Measurement
from solver.planes.plane_d import on_deformation_plane, unproject

MAX_ITERATIONS = 40
TOLERANCE = 1e-9  # rad


def moment_sensor(measurement: Measurement) -> Estimate:
    """Estimate contact distance x_c, force f, inclination psi, derived values, with covariance."""
    if measurement.moment_y is None:
        return Estimate(Outcome.INVALID, "the frame has no reading of a moment sensor")
    if measurement.rig.sensors.moment_y is None:
        return Estimate(Outcome.INVALID, "the rig states no sigma of its moment sensor")
    if not measurement.viewpoint_known:
        return Estimate(Outcome.NOT_IDENTIFIABLE, UNKNOWN_VIEWPOINT)
    if len(measurement.points) < MIN_POINTS:
        return Estimate(
            Outcome.NOT_IDENTIFIABLE,
            f"{len(measurement.points)} visible points, needed are {MIN_POINTS}",
        )
    # About the y axis of the beam's frame; the force has no moment about its x axis.
    axis = measurement.handedness * measurement.antenna_from_beam[1, 1]
    moment = measurement.moment_y / axis
    moment_sigma = measurement.rig.sensors.moment_y / abs(axis)
    refusal = no_contact(nearest_linear_bend(measurement))
    if refusal is not None:
        if (
            refusal.outcome is Outcome.NO_CONTACT
            and abs(moment) > THRESHOLDS.contact_sigmas * moment_sigma
        ):
            return Estimate(
                Outcome.EDGE_ON, "the sensor measures a force, but the image shows no bend"
            )
        return refusal

    rigidity = measurement.rig.beam.flexural_rigidity

    def mean_at(psi: float) -> tuple[MeanOfPairs, Measurement] | Estimate:
        planar = on_deformation_plane(measurement, psi)
        if planar is None:
            return Estimate(
                Outcome.EDGE_ON,
                f"a plane inclined by {math.degrees(psi):.1f} deg is seen edge-on",
            )
        mean = mean_of_pairs(planar)
        return mean if isinstance(mean, Estimate) else (mean, planar)

    psi, step, previous = 0.0, math.inf, None
    for iteration in range(1, MAX_ITERATIONS + 1):
        result = mean_at(psi)
        if isinstance(result, Estimate):
            return result
        mean, planar = result
        excess = _inclination(mean.x_c, mean.load, psi, moment, rigidity) - psi
        if abs(excess) < TOLERANCE:
            covariance = _covariance(
                measurement, planar, mean, psi, (moment, moment_sigma, rigidity)
            )
            contact = LinearContact(mean.x_c, mean.load, covariance, psi)
            return estimate_from_linear_fit(
                contact, planar, f"mean of {mean.pairs} pairs", iterations=iteration
            )
        change = excess
        if previous is not None and previous[1] != excess:  # Aitken: secant through both points
            change = -excess * (psi - previous[0]) / (excess - previous[1])
        if abs(change) > step / 2:
            change = math.copysign(min(abs(change), step / 2), excess)
        previous, step = (psi, excess), abs(change) if previous is not None else math.inf
        psi += change
    return Estimate(Outcome.NOT_CONVERGED, iterations=MAX_ITERATIONS)


def _inclination(
    x_c: float,
    load: float,
    psi: float,
    moment: float,
    rigidity: float,
    scale_error: float = 0.0,
    rigidity_error: float = 0.0,
) -> float:
    """Compute the inclination [rad] of the force from the sensor's moment and the image's load."""
    y_c, theta_c = 2 * load * x_c**3, math.atan(3 * load * x_c**2)
    lever = (x_c * math.cos(theta_c) + y_c * math.sin(theta_c)) * (1 + scale_error)
    force = 6 * rigidity * load * (1 + rigidity_error) / (1 + scale_error) ** 2
    return math.atan2(-moment / lever, force * math.cos(psi))


def _covariance(
    measurement: Measurement,
    planar: Measurement,
    mean: MeanOfPairs,
    psi: float,
    sensor: tuple[float, float, float],
) -> Floats:
    """Compute the covariance (8, 8) of x_c, load and psi by the implicit function theorem.

    `sensor` is (moment [N m], its sigma, EI).
    """
    moment, moment_sigma, rigidity = sensor
    variance_inflation = nearest_linear_bend(planar).variance_inflation
    fixed_plane = errors_of_planar_fit(planar, mean.noise * variance_inflation, mean.by_base)
    # Derivative of the mean by the inclination of the plane onto which the points are un-projected.
    _, _, points_by_psi = unproject(measurement.points, measurement.view.viewpoint, psi)
    by_plane = mean.moved(points_by_psi[mean.rows])
    # Derivatives of inclination(x_c, load, psi, moment, scale, EI), by central differences.
    point = np.array([mean.x_c, mean.load, psi, moment, rigidity, 0.0, 0.0])
    moment_unit = rigidity * mean.load * mean.x_c  # of the moment's order of magnitude
    size = np.array([mean.x_c, mean.load, 1.0, moment_unit, 1.0, 1.0, 1.0]) * 1e-6
    slopes = np.zeros(7)
    for i in (0, 1, 2, 3, 5, 6):
        ahead, behind = point.copy(), point.copy()
        ahead[i] += size[i]
        behind[i] -= size[i]
        slopes[i] = (_inclination(*ahead) - _inclination(*behind)) / (2 * size[i])
    by_x_c, by_load, by_psi, by_moment, _, by_scale, by_rigidity = slopes
    denominator = 1 - by_psi - by_x_c * by_plane[0] - by_load * by_plane[1]
    row = np.zeros(ERRORS)
    row[[X_C, LOAD, SCALE, RIGIDITY]] = np.array([by_x_c, by_load, by_scale, by_rigidity])
    row /= denominator
    along_psi = np.zeros(ERRORS)
    along_psi[[X_C, LOAD, PSI]] = [*by_plane, 1.0]
    jacobian = np.eye(ERRORS) + np.outer(along_psi, row)
    by_reading = along_psi * by_moment / denominator
    return jacobian @ fixed_plane @ jacobian.T + np.outer(by_reading, by_reading) * moment_sigma**2
