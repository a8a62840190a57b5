"""Paper's stiffness sensing (section VI-C): the object's compliance from two-point contacts.

The object's contact point has moved by w_s = w_p - y_c (30), where w_p is the beam's displacement
there without the object, and its stiffness is k_s = f / w_s (31). Corrections to the paper:
w_p = x_c tan(dtheta) for a contact at a fixed place; the printed x_c dtheta is 2.3 % off at 15
degrees and gives stiff objects a negative stiffness. The compliance 1/k_s = w_s / f is estimated,
which is regular for a rigid object; the stiffness is reported only if the compliance exceeds two
sigma.

The pushing angle dtheta counts from first contact, which need not be in a frame. The load that
bends the beam to the shape of (9) and (10) is fitted to each frame with the contact of the last
frame. It grows as tan(dtheta) for an object on a linear spring; the motor angle at which it
vanishes, by least squares over the frames so far, is the onset. An error of the contact changes all
loads by nearly the same factor, and so hardly the onset. A single frame has no onset, and its
estimate has no compliance.

x_c and f are those of `two_point`, linear theory, with its bias at large deflections, which the
covariance does not include.
"""

import math
from dataclasses import dataclass

import numpy as np

from solver.baselines.two_point import MeanOfPairs, mean_of_pairs, two_point
from solver.beams.linear import unit_deflection, unit_slope
from solver.core.least_squares import Rows, fit_rows
from solver.core.thresholds import THRESHOLDS
from solver.fitting.first_contact import nearest_linear_bend
from solver.fitting.verdict import single_frame
from solver.instrument.arrays import Floats
from solver.instrument.estimate import Estimate, Outcome
from solver.instrument.measurement import Measurement
from solver.planes.plane_d import known_plane


@dataclass(frozen=True)
class _Load:
    """Motor angle [rad] of a frame, and its load f / (6 EI) [1/m^2] for a given contact.

    `by_y` (n,) is the load's derivative by the points' y, `by_base` (3,) by the clamp's
    (dx, dy, tilt), `sigma` its sigma due to the points' errors.
    """

    motor_angle: float
    load: float
    sigma: float
    by_y: Floats
    by_base: Floats


@dataclass(frozen=True)
class _Onset:
    """Motor angle [rad] of first contact; its derivatives (n,) by each load and motor angle."""

    angle: float
    by_load: Floats
    by_motor: Floats


def stiffness(measurement: Measurement) -> Estimate:
    """Estimate x_c, force, the object's compliance and the onset, with their joint covariance."""
    single = two_point(measurement)
    plane = known_plane(measurement)
    if not single.values or isinstance(plane, Estimate):
        return single
    if measurement.motor_angle is None:
        return single_frame(single, "no motor angle is read")
    mean = mean_of_pairs(plane[0])
    assert not isinstance(mean, Estimate)
    loads = _loads(measurement, mean.x_c)
    encoder = max(measurement.rig.tolerances.encoder, THRESHOLDS.min_encoder_sigma)
    if len(loads) < 2:
        return single_frame(single, "no earlier frame shows a bend")
    if np.ptp([load.motor_angle for load in loads]) < THRESHOLDS.min_turn_sigmas * encoder:
        return single_frame(single, "the motor has not turned")
    onset = _onset(loads, measurement.rig.deflects_towards, encoder)
    if onset is None:
        return Estimate(Outcome.INVALID, "the loads do not fit a push from one first contact")
    errors = _errors(loads, onset, mean, plane[0], encoder)
    values, covariance = _quantities(mean, onset, plane[0], errors)
    return Estimate(single.outcome, f"{len(loads)} frames", values=values, covariance=covariance)


def _loads(measurement: Measurement, x_c: float) -> list[_Load]:
    """Compute the loads of the bent frames so far, in order of time, for a contact at x_c."""
    loads = []
    for frame in (*measurement.earlier, measurement):
        plane = known_plane(frame)
        if frame.motor_angle is None or isinstance(plane, Estimate):
            continue
        planar = plane[0]
        if nearest_linear_bend(planar).significance < THRESHOLDS.contact_sigmas:
            continue
        x, y = planar.points.T
        unit = unit_deflection(x, x_c)
        by_y = unit / float(unit @ unit)
        load = float(by_y @ y)
        slope = load * unit_slope(x, x_c)
        along, across = planar.total_sigma_vectors.T
        sigma = float(np.linalg.norm(by_y * (across - slope * along)))
        by_base = np.array([-by_y @ slope, by_y.sum(), by_y @ x])
        loads.append(_Load(frame.motor_angle, load, sigma, by_y, by_base))
    return loads


def _onset(loads: list[_Load], side: int, encoder: float) -> _Onset | None:
    """Fit load = growth tan(side (onset - motor angle)) by least squares; None if that fails."""
    angles = np.array([load.motor_angle for load in loads])
    measured = np.array([load.load for load in loads])
    slope, level = np.polyfit(angles, measured, 1)
    # The load grows as the motor turns the beam against the object.
    growth = -side * float(slope)
    if growth <= 0 or np.abs(angles + level / slope).max() >= math.pi / 2:
        return None
    sigma = np.hypot([load.sigma for load in loads], growth * encoder)

    def residuals(p: Floats) -> Rows | None:
        growth, onset = p
        pushing = side * (onset - angles)
        if np.abs(pushing).max() >= math.pi / 2:
            return None
        tangent = np.tan(pushing)
        by_onset = growth * side * (1 + tangent**2)
        jacobian = np.array([tangent, by_onset]) / sigma
        return Rows((growth * tangent - measured) / sigma, jacobian)

    fit = fit_rows(residuals, np.array([growth, -level / slope]))
    linearised = residuals(fit.parameters)
    if linearised is None or not fit.converged or fit.rank_deficient or fit.parameters[0] <= 0:
        return None
    by_load = (fit.covariance @ linearised.jacobian)[1] / sigma
    # A larger motor angle changes the residual as a smaller onset does.
    return _Onset(float(fit.parameters[1]), by_load, by_load * linearised.jacobian[1] * sigma)


def _quantities(
    mean: MeanOfPairs, onset: _Onset, planar: Measurement, errors: Floats
) -> tuple[dict[str, float], Floats]:
    """Compute the values of the last frame and their covariance from that of `_errors`."""
    x_c, load, rigidity = mean.x_c, mean.load, planar.rig.beam.flexural_rigidity
    y_c, force = 2 * load * x_c**3, 6 * rigidity * load
    assert planar.motor_angle is not None
    tangent = math.tan(planar.rig.deflects_towards * (onset.angle - planar.motor_angle))
    shift = x_c * tangent - y_c  # (30)
    compliance = shift / force  # (31)
    values = {
        "x_c_m": x_c,
        "y_c_m": y_c,
        "force_n": force,
        "f_n": force,
        "compliance_m_per_n": compliance,
        "onset_angle_rad": onset.angle,
    }
    by_force = [0.0, 6 * rigidity, 0.0, 6 * load, 0.0]
    by_compliance = [
        (tangent - 3 * y_c / x_c) / force,
        -(2 * x_c**3 + shift / load) / force,
        x_c * (1 + tangent**2) / force,
        -compliance / rigidity,
        0.0,
    ]
    rows = [
        [1.0, 0.0, 0.0, 0.0, 0.0],
        [3 * y_c / x_c, 2 * x_c**3, 0.0, 0.0, 0.0],
        by_force,
        by_force,
        by_compliance,
        [0.0, 0.0, 0.0, 0.0, 1.0],
    ]
    if compliance > THRESHOLDS.soft_sigmas * math.sqrt(
        float(by_compliance @ errors @ by_compliance)
    ):
        values["stiffness_n_per_m"] = 1 / compliance
        rows.append([-part / compliance**2 for part in by_compliance])
    jacobian = np.array(rows)
    return values, jacobian @ errors @ jacobian.T


def _errors(
    loads: list[_Load], onset: _Onset, mean: MeanOfPairs, planar: Measurement, encoder: float
) -> Floats:
    """Compute the covariance (5, 5) of the last x_c, load, pushing angle, of EI, and of the onset.

    The errors of points and motor angle are independent between frames; those of the clamp's pose,
    the scale of lengths and EI are common to all.
    """
    side, tolerances = planar.rig.deflects_towards, planar.rig.tolerances
    last = len(loads) - 1

    def row(x_c: Floats | float, load: Floats | float, onset: Floats | float) -> Floats:
        """Combine errors of the last shape and of the onset, which changes the pushing angle."""
        return np.array([x_c + 0 * onset, load + 0 * onset, side * onset, 0 * onset, onset])

    along, across = planar.total_sigma_vectors.T
    zeros = np.zeros_like(across)
    covariance = np.zeros((5, 5))
    by_clamp = row(mean.by_base[0], mean.by_base[1], np.zeros(3))
    for i, load in enumerate(loads):
        by_clamp += row(0.0, 0.0, onset.by_load[i] * load.by_base)
        motor = row(0.0, 0.0, float(onset.by_motor[i]))
        if i == last:
            motor[2] -= side
        covariance += np.outer(motor, motor) * encoder**2
        if i < last:
            noise = row(0.0, 0.0, float(onset.by_load[i]) * load.sigma)
            covariance += np.outer(noise, noise)
    # The last frame's points affect both its contact and its part of the onset.
    by_contact = np.vstack([zeros, zeros])
    by_contact[:, mean.rows] = mean.by_point
    slope = zeros.copy()
    slope[mean.rows] = mean.slope
    points = row(by_contact[0], by_contact[1], onset.by_load[last] * loads[last].by_y)
    points = points * (across - slope * along)
    covariance += points @ points.T
    covariance += by_clamp @ planar.base_covariance @ by_clamp.T
    # The onset is an angle: the scale does not change it.
    scale = row(mean.x_c, -2 * mean.load, 0.0)
    covariance += np.outer(scale, scale) * planar.scale_sigma**2
    covariance[3, 3] += tolerances.flexural_rigidity**2
    return covariance
