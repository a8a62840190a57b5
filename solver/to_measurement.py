"""Convert a centreline in the image to a measurement in the frame of the beam at rest."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from solver.antenna import Antenna
from solver.at_rest.pose import Rest
from solver.centreline import Centreline
from solver.instrument.arrays import Floats
from solver.instrument.image_frame import NO_READINGS, Readings
from solver.instrument.measurement import Measurement, Tip, View
from solver.instrument.rig import Rig
from solver.planes.plane_c import on_plane
from solver.planes.sag import correct_for_sag

# Powers of the distance that describe a bent beam across its direction at the clamp (the first two
# for a short stretch), and the fewest points of such a fit.
CURVE_POWERS, MIN_CURVE_POINTS = (2, 3, 4, 5, 6), 8
# Nodes of the arc length's integral along the beam. Derived: at a slope of 1 its error is 1e-5.
ARC_NODES = 61
# Number of last points before the tip, which give the direction of the beam's straight end.
TIP_POINTS = 30
# Where the light comes from along the beam, at a tangent of 1 to the camera's direction, the middle
# of the shading moves by this many radii per radian by which the beam turns. Derived, for a matt
# cylinder: the brightness sqrt(1 - x^2) + t x has its middle at t (2/3) / (pi/2).
SHADING = 4 / (3 * math.pi)
# Its relative sigma. Measured: matt, glossy and bare beams lit from the side moved by 1.0 to 1.6
# times as much.
SHADING_SIGMA = 0.3


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
    camera, rig, rest = antenna.calibration.camera, antenna.rig, antenna.rest
    points, sigmas = on_plane(camera, line.points, line.directions * line.sigma[:, None])
    points = correct_for_sag(points, camera.viewpoint, rig)
    if readings.removed is not None:
        low, high = readings.removed
        outside = (points[:, 0] < low) | (points[:, 0] > high)
        points, sigmas = points[outside], sigmas[outside]
    course = _course(points, rest, rig)
    shared = np.empty((len(points), 0))
    if course is not None:
        normals = course.normals
        across = np.maximum(np.abs((sigmas * normals).sum(axis=1)), 1e-15)
        # The shading's middle moves away from the light's side as the beam turns.
        shift = SHADING * antenna.at_rest.shading * rig.beam.radius * course.turn
        points = points + (rig.light_slope * shift - course.bow)[:, None] * normals
        slope_sigma = math.hypot(rig.light_slope_sigma, SHADING_SIGMA * rig.light_slope)
        errors = np.column_stack([course.bow_errors, slope_sigma * shift])
        shared = errors / across[:, None]
    axes, clamp = antenna.antenna_from_beam[:2, :2], antenna.antenna_from_beam[:2, 3]
    bow_error = _bow_error(points, rest)
    points = (points - clamp) @ axes
    return Measurement(
        view=View(
            points,
            sigmas @ axes,
            antenna.viewpoint,
            _tip(antenna, line, points),
            shared,
        ),
        base_covariance=_base_covariance(antenna, line),
        scale_sigma=math.hypot(antenna.lengths_sigma, bow_error),
        motor_angle=None if antenna.in_world else readings.motor_angle,
        rig=rig,
        antenna_from_beam=antenna.antenna_from_beam,
        moment_y=readings.moment_y,
        base_force=readings.base_force,
        base_moment=readings.base_moment,
        earlier=tuple(earlier),
        viewpoint_known=antenna.calibration.viewpoint_known,
        tip_sigma=antenna.tip_sigma,
    )


def _base_covariance(antenna: Antenna, line: Centreline) -> Floats:
    """Compute the clamp's covariance (3, 3), including the error that all points share."""
    covariance = antenna.base_covariance.copy()
    covariance[1, 1] += (line.common_sigma * antenna.pixel) ** 2
    return covariance


def _tip(antenna: Antenna, line: Centreline, points: Floats) -> Tip | None:
    """Locate the tip in the frame of the beam at rest, where `points` (n, 2) [m] of the beam are.

    An end that is cut, rounded or shaded looks longer or shorter than the beam is, by the same
    amount at rest and when bent: the excess in the rest images is subtracted along the beam's end.
    """
    if line.tip is None or line.tip_covariance is None:
        return None
    tip, covariance = antenna.tip_in_beam_frame(line.tip, line.tip_covariance)
    at_rest = antenna.tip_at_rest
    if at_rest is not None and len(points):
        # Points come in order from the clamp to the tip.
        along = tip - points[-TIP_POINTS:].mean(axis=0)
        excess = at_rest.point[0] - antenna.rig.beam.length
        tip = tip - excess / math.hypot(*along) * along
    return Tip(tip, covariance)


class _Course(NamedTuple):
    """The bent beam's course at n points, and the errors that follow it.

    `normals` (n, 2) are unit vectors on C, `turn` (n,) [rad] is the direction less that at rest,
    `bow` (n,) [m] and `bow_errors` (n, 5) [m] are along the normals.
    """

    normals: Floats
    turn: Floats
    bow: Floats
    bow_errors: Floats


def _course(points: Floats, rest: Rest, rig: Rig) -> _Course | None:
    """Compute the course of the beam with points (n, 2) on C; None for too few points.

    A bow moves every point of the bent beam along its normal there, by as much as at rest. Arc
    lengths and normals are those of a smooth curve through the points that leaves the clamp as the
    beam at rest does, so that they also hold where the beam's first part is hidden.
    """
    if len(points) < MIN_CURVE_POINTS:
        return None
    x, y = points[:, 0] - rig.base_position[0], points[:, 1] - rest.y_at_clamp
    terms = len(CURVE_POWERS) if np.ptp(x) > rest.length / 3 else 2
    powers = np.array(CURVE_POWERS[:terms])
    x_relative = x[:, None] / rest.length
    coefficients, *_ = np.linalg.lstsq(x_relative**powers, y - rest.slope * x)
    weights = coefficients * powers / rest.length

    def slope(at: Floats) -> Floats:
        return np.asarray(rest.slope + (at[:, None] / rest.length) ** (powers - 1) @ weights)

    # Arc length from the clamp, of which the bow is a function.
    nodes = np.linspace(0, max(rest.length, float(x.max())), ARC_NODES)
    steps = np.hypot(1, slope(nodes))
    arcs = np.append(0.0, np.cumsum((steps[1:] + steps[:-1]) / 2)) * nodes[1]
    arc = np.interp(x, nodes, arcs)
    here = slope(x)
    normals = np.column_stack([-here, np.ones_like(x)]) / np.hypot(1, here)[:, None]
    turn = np.arctan(here) - math.atan(rest.slope)
    return _Course(normals, turn, *rest.bow_errors_at(np.minimum(arc, rest.length)))


def _bow_error(points: Floats, rest: Rest) -> float:
    """Estimate the relative scale uncertainty left after removing the bow.

    A bow also moves the bent beam along itself, by about its size times the slope there, and
    changes the force's lever by as much.
    """
    if len(points) < 3:
        return 0.0
    slope = np.ptp(points[:, 1]) / max(float(np.ptp(points[:, 0])), 1e-12)
    return float(rest.bow_size * slope / rest.length)
