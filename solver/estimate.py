"""From images to estimates: calibrate -> rest -> centreline -> plane -> method."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.integrate import cumulative_trapezoid

from solver.antenna import Antenna
from solver.at_rest import Learn, learn_at_rest
from solver.calibrate import calibrate
from solver.calibrate.certainty import certainty
from solver.centreline import Centreline
from solver.centreline.beam import learn_beam
from solver.centreline.guide import Guide
from solver.instrument.arrays import Floats, Grey
from solver.instrument.errors import InputError
from solver.instrument.estimate import Estimate, Outcome
from solver.instrument.gray_scale import gray_scale
from solver.instrument.measurement import Measurement, Tip, View
from solver.instrument.observation import NOTHING_READ, Observations, Readings
from solver.instrument.rig import Rig
from solver.methods import Method
from solver.plane import on_plane
from solver.rest import Rest
from solver.sag import raised

WORST_REPROJECTION_PX = 0.5
# A bent beam's course across its direction at the clamp, in powers of the distance; of a short
# stretch the first two, and none of fewer points than these.
CURVE_POWERS, LEAST_CURVE_POINTS = (2, 3, 4, 5, 6), 8
# The last points before the tip, which show the direction of the beam's straight end.
BESIDE_TIP = 30


def set_up(observations: Observations, learn: Learn = learn_beam) -> Antenna:
    """Calibrate the camera, learn the beam's look and its rest pose.

    `learn` makes the extractor from the images of the beam at rest. Raises InputError if the
    images forbid it.
    """
    rig = observations.rig
    calibration = calibrate(observations.read_board_views(), rig)
    if calibration.reprojection_px > WORST_REPROJECTION_PX:
        raise InputError(
            f"the calibration leaves {calibration.reprojection_px:.2f} px, allowed is "
            f"{WORST_REPROJECTION_PX:g} px: is the rig's board the one in the views, and has the "
            f"lens no more distortion than the rig's {rig.distortion_coefficients} coefficients "
            "can describe?"
        )
    scale = gray_scale(observations.read_rest_images(), rig.bits)
    images = [scale(image) for image in observations.read_rest_images()]
    nominal = np.diag([1.0, rig.deflects_towards, 1.0, 1.0])
    nominal[:3, 3] = rig.base_position
    in_world = rig.camera_mount == "world"
    guide = Guide(
        calibration.camera,
        nominal,
        rig.beam.length,
        rig.beam.radius,
        in_world,
        scale.full_scale,
    )
    at_rest = learn_at_rest(images, guide, learn, calibration, rig)
    known = certainty(calibration, rig)
    return Antenna(rig, calibration, at_rest, known.clamp, known.scale, scale)


def measure(
    antenna: Antenna,
    line: Centreline,
    readings: Readings = NOTHING_READ,
    earlier: Sequence[Measurement] = (),
) -> Measurement:
    """The visible beam of an image, carried onto plane C, in the frame of the beam at rest.

    `earlier` are the measurements of the same push before this one. Points within the readings'
    removed stretch are left out.
    """
    camera, rig, rest = antenna.calibration.camera, antenna.rig, antenna.rest
    points, sigmas = on_plane(camera, line.points, line.directions * line.sigma[:, None])
    points = raised(points, camera.viewpoint, rig)
    if readings.removed is not None:
        low, high = readings.removed
        kept = (points[:, 0] < low) | (points[:, 0] > high)
        points, sigmas = points[kept], sigmas[kept]
    if not rest.straight:
        points, sigmas = _unbowed(points, sigmas, rest, rig)
    axes, clamp = antenna.antenna_from_beam[:2, :2], antenna.antenna_from_beam[:2, 3]
    bow_error = _bow_error(points, rest)
    points = (points - clamp) @ axes
    return Measurement(
        view=View(points, sigmas @ axes, antenna.viewpoint, _tip(antenna, line, points)),
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
    """The clamp's covariance (3, 3); an error that all points share is one of the clamp's place."""
    covariance = antenna.base_covariance.copy()
    covariance[1, 1] += (line.common_sigma * antenna.pixel) ** 2
    return covariance


def _tip(antenna: Antenna, line: Centreline, points: Floats) -> Tip | None:
    """Locate the tip in the frame of the beam at rest, where `points` (n, 2) [m] of the beam are.

    An end that is cut, rounded or shaded looks longer or shorter than the beam is, at rest as much
    as when bent: what the rest images show of that is taken off along the beam's end.
    """
    if line.tip is None or line.tip_covariance is None:
        return None
    tip = antenna.tip_in_beam_frame(line.tip, line.tip_covariance)
    at_rest = antenna.tip_at_rest
    if at_rest is None or not len(points):
        return tip
    # Points come in order from the clamp to the tip.
    along = tip.point - points[-BESIDE_TIP:].mean(axis=0)
    excess = at_rest.point[0] - antenna.rig.beam.length
    return Tip(tip.point - excess / math.hypot(*along) * along, tip.covariance)


def _unbowed(points: Floats, sigmas: Floats, rest: Rest, rig: Rig) -> tuple[Floats, Floats]:
    """Points (n, 2) on C and their one-sigma vectors, as a straight beam would show them.

    A bow moves every point of the bent beam along its normal there, by as much as at rest. Arc
    lengths and normals are those of a smooth curve through the points that leaves the clamp as the
    beam at rest does, so that it also holds where the beam's first part is hidden.
    """
    if len(points) < LEAST_CURVE_POINTS:
        return points, sigmas
    x, y = points[:, 0] - rig.base_position[0], points[:, 1] - rest.y_at_clamp
    terms = len(CURVE_POWERS) if np.ptp(x) > rest.length / 3 else 2
    powers = np.array(CURVE_POWERS[:terms])
    place = x[:, None] / rest.length
    coefficients, *_ = np.linalg.lstsq(place**powers, y - rest.slope * x)
    weights = coefficients * powers / rest.length

    def slope(at: Floats) -> Floats:
        return np.asarray(rest.slope + (at[:, None] / rest.length) ** (powers - 1) @ weights)

    # Arc length from the clamp, by which the bow is known.
    fine = np.linspace(0, max(rest.length, float(x.max())), 241)
    arc = np.interp(x, fine, cumulative_trapezoid(np.hypot(1, slope(fine)), fine, initial=0.0))
    bow, bow_sigma = rest.bow_at(np.minimum(arc, rest.length))
    # All points share the bow's error: they tell as little of it as its three coefficients do.
    bow_sigma *= math.sqrt(max(len(x) / len(rest.bow), 1.0))
    normal = np.column_stack([-slope(x), np.ones_like(x)]) / np.hypot(1, slope(x))[:, None]
    size = np.maximum(np.linalg.norm(sigmas, axis=1), 1e-15)
    return points - bow[:, None] * normal, sigmas * (np.hypot(size, bow_sigma) / size)[:, None]


def _bow_error(points: Floats, rest: Rest) -> float:
    """What taking a bow off leaves, a relative sigma of lengths.

    A bow also moves the bent beam along itself, by about its size times the slope there, and the
    force's lever with it.
    """
    if rest.straight or len(points) < 3:
        return 0.0
    bow, sigma = rest.bow_at(np.linspace(0.0, rest.length, 50))
    slope = np.ptp(points[:, 1]) / max(float(np.ptp(points[:, 0])), 1e-12)
    return float(np.sqrt(np.mean(bow**2 + sigma**2)) * slope / rest.length)


def see(antenna: Antenna, image: Grey) -> Centreline:
    """The beam's centreline in a gray image (height, width).

    Raises InputError if the image is not of the calibrated camera's size and kind.
    """
    camera = antenna.calibration.camera
    if image.ndim != 2 or image.dtype not in (np.uint8, np.uint16):
        raise InputError(
            f"the image has shape {image.shape} and type {image.dtype}, "
            "allowed is one channel of 8 or 16 bits"
        )
    if image.shape != (camera.height, camera.width):
        raise InputError(
            f"the image has {image.shape[1]} x {image.shape[0]} px, "
            f"the calibration {camera.width} x {camera.height}"
        )
    # Compiled for one layout of an image only.
    return antenna.extract(np.ascontiguousarray(antenna.scale(image)))


def moved(antenna: Antenna, image: Grey) -> Estimate | None:
    """Refuse an image (height, width) whose landmarks have moved since the rest images."""
    shift = antenna.at_rest.landmarks.shift_of(np.ascontiguousarray(antenna.scale(image)))
    if shift is None or not shift.exceeds(antenna.rig.tolerances.camera_shift_px):
        return None
    return Estimate(
        Outcome.CAMERA_MOVED,
        f"the image has shifted by {shift.du:.2f} px along its rows and {shift.dv:.2f} px down "
        "since the rest images: take those again",
    )


def estimate(
    antenna: Antenna,
    image: Grey,
    method: Method,
    readings: Readings = NOTHING_READ,
    earlier: Sequence[Measurement] = (),
) -> Estimate:
    """One frame's answer; an error of any kind becomes an outcome, never an exception."""
    try:
        line = see(antenna, image)
        refusal = moved(antenna, image)
        if refusal is not None:
            return refusal
        measurement = measure(antenna, line, readings, earlier)
    except (InputError, ValueError) as error:
        return Estimate(Outcome.INVALID, str(error))
    except Exception as error:  # noqa: BLE001 - any failure is a row in the table
        return Estimate(Outcome.CRASHED, f"{type(error).__name__}: {error}")
    return answer(method, measurement, line.remark)


def answer(method: Method, measurement: Measurement, remark: str = "") -> Estimate:
    """What a method says of a measurement; whatever else it does is the outcome "crashed".

    A `remark` on the image is added to the message.
    """
    try:
        given: object = method(measurement)
    except (Exception, SystemExit) as error:  # noqa: BLE001 - any failure is a row in the table
        return Estimate(Outcome.CRASHED, f"{type(error).__name__}: {error}")
    if not isinstance(given, Estimate):  # a method of someone else's may return anything
        return Estimate(Outcome.CRASHED, f"returned {type(given).__name__}, not an Estimate")
    return replace(given, message="; ".join(filter(None, (given.message, remark))))
