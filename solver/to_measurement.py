"""Convert a centreline in the image to a measurement in the frame of the beam at rest."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from solver.antenna import Antenna
from solver.at_rest.bent_line import bent_line
from solver.at_rest.rest_line import RestLine
from solver.centreline import Centreline
from solver.instrument.arrays import Floats
from solver.instrument.image_frame import NO_READINGS, Readings
from solver.instrument.measurement import Measurement, RestBow, Tip, View
from solver.instrument.rig import Rig
from solver.instrument.transforms import turn_about_z
from solver.planes.own_weight import OwnWeight, bow_by_own_weight
from solver.planes.plane_c import on_plane
from solver.planes.sag import correct_for_sag
from solver.planes.shading import axis_sigma, shading_of

# Number of last points before the tip, which give the direction of the beam's straight end.
TIP_POINTS = 30


def to_measurement(
    antenna: Antenna,
    line: Centreline,
    readings: Readings = NO_READINGS,
    earlier: Sequence[Measurement] = (),
) -> Measurement:
    """Project the visible beam onto plane C, in the frame of the beam at rest.

    `earlier` are the measurements of the same push before this one. Points within the readings'
    removed stretch are left out.
    """
    antenna = antenna.without(line.grid_error)
    camera, rig, rest = antenna.calibration.camera, antenna.rig, antenna.rest
    points = line.points - line.shift
    points, sigmas = on_plane(camera, points, line.directions * line.sigma[:, None])
    points = correct_for_sag(points, camera.viewpoint, rig)
    lost_light = line.lost_light
    if readings.removed is not None:
        low, high = readings.removed
        outside = (points[:, 0] < low) | (points[:, 0] > high)
        points, sigmas, lost_light = points[outside], sigmas[outside], lost_light[outside]
    bent = bent_line(points, rest, rig)
    motor_angle = None if antenna.in_world else readings.motor_angle
    by_weight, weight_covariance = np.zeros(3), np.zeros((5, 5))
    if bent is not None and rig.sag_in_plane.any():
        weight = _by_own_weight(antenna, points, bent.turn, motor_angle)
        by_weight, weight_covariance = weight.bow, _weight_covariance(weight.bow, rig)
        rest = replace(rest, bow=rest.bow + by_weight)
        points = points - weight.remainder[:, None] * bent.normals
        bent = bent_line(points, rest, rig)
    shared, removed = np.empty((len(points), 0)), np.zeros_like(points)
    if bent is not None:
        normals, bow_errors = bent.normals, bent.bow_errors
        across = np.maximum(np.abs((sigmas * normals).sum(axis=1)), 1e-15)
        x = points[:, 0] - rig.base_position[0]
        moved = points[:, 1] - rest.y_at_clamp - rest.slope * x
        response = antenna.extract.shading
        shading = shading_of(rig, camera.viewpoint, response, x, moved, bent.turn)
        removed = bent.bow[:, None] * normals
        shift = shading.shift
        share = rest.share_that_follows(bent.arc, bent.beside, across)
        if share:
            rest, shift = rest.following(share), shift + share * rest.pattern_at(bent.arc)
            _, bow_errors = rest.bow_errors_at(bent.arc * rest.length)
        points = points - shift[:, None] * normals - removed
        errors = np.column_stack([bow_errors, shading.errors])
        shared = errors / across[:, None]
    axes, clamp = antenna.antenna_from_beam[:2, :2], antenna.antenna_from_beam[:2, 3]
    bow_error = _bow_error(points, rest)
    image_shift = antenna.by_pixel.T @ line.shift_covariance @ antenna.by_pixel
    # The error that all points share.
    image_shift[1, 1] += (line.common_sigma * antenna.pixel) ** 2
    base_covariance = antenna.base_covariance.copy()
    base_covariance[1:, 1:] += rest.line_covariance - antenna.rest.line_covariance
    base_covariance[:2, :2] += image_shift
    points = (points - clamp) @ axes
    return Measurement(
        view=View(
            points,
            sigmas @ axes,
            antenna.viewpoint,
            _tip(antenna, line, points),
            shared,
            lost_light,
        ),
        base_covariance=base_covariance,
        scale_sigma=math.hypot(antenna.lengths_sigma, bow_error),
        motor_angle=motor_angle,
        rig=rig,
        antenna_from_beam=antenna.antenna_from_beam,
        moment_y=readings.moment_y,
        base_force=readings.base_force,
        base_moment=readings.base_moment,
        earlier=tuple(earlier),
        viewpoint_known=antenna.calibration.viewpoint_known,
        tip_sigma=antenna.tip_sigma,
        image_shift=image_shift,
        axis_sigma=axis_sigma(rig, antenna.extract.shading),
        rest_bow=RestBow(
            coefficients=antenna.rest.bow * axes[1, 1],
            by_weight=by_weight * axes[1, 1],
            covariance=rest.covariance + weight_covariance,
            line_covariance=rest.line_covariance,
            removed=removed @ axes,
            scale_sigma=bow_error,
            errors=0 if bent is None else bent.bow_errors.shape[1],
        ),
    )


def _by_own_weight(
    antenna: Antenna, points: Floats, turn: Floats, motor_angle: float | None
) -> OwnWeight:
    """Compute the change [m] of the bow since rest by the beam's own weight, in Sigma_a.

    Without a motor angle the camera is fixed in the world, and Sigma_a is Sigma_o.
    """
    rig, rest = antenna.rig, antenna.rest
    tilt = math.atan(rest.slope)
    along = turn_about_z(-tilt)[:2, :2]
    places = (points - rig.base_position[:2] - [0.0, rest.y_at_clamp]) @ along.T / rest.length
    sag = along @ rig.sag_in_plane / rest.length
    now = turn_about_z(-(motor_angle or 0.0))[:2, :2] @ sag
    found = bow_by_own_weight(places[:, 0], turn, rest.bow / rest.length, now, sag)
    return OwnWeight(found.bow * rest.length, found.remainder * rest.length)


def _weight_covariance(by_weight: Floats, rig: Rig) -> Floats:
    """Compute the covariance (5, 5) of line and bow due to the error of EI, and of the sag."""
    stated = rig.tolerances.flexural_rigidity / rig.beam.flexural_rigidity
    error = np.append(np.zeros(2), math.hypot(stated, rig.shape.rigidity_sigma) * by_weight)
    return np.outer(error, error)


def _tip(antenna: Antenna, line: Centreline, points: Floats) -> Tip | None:
    """Locate the tip in the frame of the beam at rest, where `points` (n, 2) [m] of the beam are.

    An end that is cut, rounded or shaded looks longer or shorter than the beam is, by the same
    amount at rest and when bent: the excess in the rest images is subtracted along the beam's end.
    The rig states how far that may be wrong, where light and view of the end change.
    """
    if line.tip is None or line.tip_covariance is None:
        return None
    tip, covariance = antenna.tip_in_beam_frame(line.tip - line.shift, line.tip_covariance)
    at_rest = antenna.tip_at_rest
    if len(points):
        # Points come in order from the clamp to the tip.
        along = tip - points[-TIP_POINTS:].mean(axis=0)
        along /= math.hypot(*along)
        if at_rest is not None:
            tip = tip - (at_rest.point[0] - antenna.rig.beam.length) * along
        covariance = covariance + antenna.rig.tolerances.tip**2 * np.outer(along, along)
    return Tip(tip, covariance, antenna.rim)


def _bow_error(points: Floats, rest: RestLine) -> float:
    """Estimate the relative scale uncertainty left after removing the bow.

    A bow also moves the bent beam along itself, by about its size times the slope there, and
    changes the force's lever by as much.
    """
    if len(points) < 3:
        return 0.0
    slope = np.ptp(points[:, 1]) / max(float(np.ptp(points[:, 0])), 1e-12)
    return float(rest.bow_size * slope / rest.length)
