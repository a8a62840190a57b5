"""From images to estimates: calibrate -> centreline -> plane -> method."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from solver.calibrate import Calibration, calibrate
from solver.centreline import Centreline, Extractor
from solver.centreline.area_weighted import area_weighted
from solver.fitting.correlation import correlation_length
from solver.instrument.arrays import Floats, Grey
from solver.instrument.errors import InputError
from solver.instrument.estimate import Estimate, Outcome
from solver.instrument.images import read_grey
from solver.instrument.measurement import Measurement, View
from solver.instrument.observation import NOTHING_READ, Observations, Readings
from solver.instrument.rig import Rig
from solver.instrument.transforms import invert
from solver.methods import Method
from solver.plane import on_plane

LEAST_REST_COLUMNS = 10
WORST_REPROJECTION_PX = 0.5
# A motor whose camera stands in the world may have turned by any angle of this order [rad].
ANY_TILT = 0.5


@dataclass(frozen=True)
class Rest:
    """The beam before contact, a line on plane C: its y at the clamp [m], and its slope.

    `covariance` (2, 2) is that of (y_at_clamp, slope).
    """

    y_at_clamp: float
    slope: float
    covariance: Floats


@dataclass(frozen=True)
class Antenna:
    """All that is learned once per rig: calibrated camera and the beam at rest."""

    rig: Rig
    calibration: Calibration
    rest: Rest
    extract: Extractor


def set_up(observations: Observations, extract: Extractor = area_weighted) -> Antenna:
    """Calibrate the camera and learn the rest pose. Raises InputError if the images forbid it."""
    rig = observations.rig
    calibration = calibrate([read_grey(path) for path in observations.board_views], rig)
    if calibration.reprojection_px > WORST_REPROJECTION_PX:
        raise InputError(
            f"the calibration leaves {calibration.reprojection_px:.2f} px, allowed is "
            f"{WORST_REPROJECTION_PX:g} px: is the rig's board the one in the views, and has the "
            f"lens no more distortion than the rig's {rig.distortion_coefficients} coefficients "
            "can describe?"
        )
    rest_lines = (extract(read_grey(path)) for path in observations.rest_images)
    rest = _rest_line(rest_lines, calibration, rig)
    return Antenna(rig, calibration, rest, extract)


def measure(
    antenna: Antenna,
    line: Centreline,
    readings: Readings = NOTHING_READ,
    earlier: Sequence[Measurement] = (),
) -> Measurement:
    """The visible beam of an image, carried onto plane C, in the frame of the beam at rest.

    `earlier` are the measurements of the same push before this one. Points within the readings'
    removed stretch are left out. The angle of a motor whose camera stands in the world is not
    read: the clamp's tilt is then almost unknown, and is the motor's angle.
    """
    camera, rig, rest = antenna.calibration.camera, antenna.rig, antenna.rest
    points, sigmas = on_plane(camera, line.points, line.directions * line.sigma[:, None])
    if readings.removed is not None:
        low, high = readings.removed
        kept = (points[:, 0] < low) | (points[:, 0] > high)
        points, sigmas = points[kept], sigmas[kept]
    clamp = np.array([rig.base_position[0], rest.y_at_clamp])
    tilt = math.atan(rest.slope)
    along = np.array([math.cos(tilt), math.sin(tilt)])
    across = np.array([-math.sin(tilt), math.cos(tilt)]) * rig.deflects_towards
    axes = np.column_stack([along, across])
    antenna_from_beam = np.eye(4)
    antenna_from_beam[:2, :2], antenna_from_beam[:2, 3] = axes, clamp
    viewpoint = invert(antenna_from_beam) @ camera.viewpoint
    tolerance = rig.tolerances
    base_covariance = np.zeros((3, 3))
    base_covariance[0, 0] = tolerance.base_position**2 + tolerance.board_translation**2
    base_covariance[1:, 1:] = rest.covariance
    # A nanometre and a nanoradian keep a rig that claims to be exact from being singular.
    base_covariance += np.diag([1e-18, 1e-18, 1e-18])
    in_world = rig.camera_mount == "world"
    if in_world:
        base_covariance[2, 2] += ANY_TILT**2
    return Measurement(
        view=View((points - clamp) @ axes, sigmas @ axes, viewpoint),
        base_covariance=base_covariance,
        scale_sigma=_scale_sigma(antenna),
        motor_angle=None if in_world else readings.motor_angle,
        rig=rig,
        antenna_from_beam=antenna_from_beam,
        moment_y=readings.moment_y,
        base_force=readings.base_force,
        base_moment=readings.base_moment,
        earlier=tuple(earlier),
    )


def _scale_sigma(antenna: Antenna) -> float:
    """What the rig's tolerances leave open of all lengths, a relative sigma.

    A clamp off plane C, or a board that did not lie in it, is nearer to the camera or farther from
    it than believed: all lengths err by the same share. A board tilted about its middle is off by
    its angle times half the beam. The calibration's own scale error, a hundredth of a per cent for
    a board that fills the view, is neglected.
    """
    camera, rig = antenna.calibration.camera, antenna.rig
    tolerance = rig.tolerances
    if camera.telecentric:  # distance does not change its scale, and tilt but to second order
        return tolerance.board_rotation**2
    height = float(invert(camera.camera_from_antenna)[2, 3])
    tilted = tolerance.board_rotation * rig.beam.length / 2
    return math.hypot(tolerance.base_position, tolerance.board_translation, tilted) / height


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
    return antenna.extract(image)


def estimate(
    antenna: Antenna,
    image: Grey,
    method: Method,
    readings: Readings = NOTHING_READ,
    earlier: Sequence[Measurement] = (),
) -> Estimate:
    """One frame's answer; an error of any kind becomes an outcome, never an exception."""
    try:
        measurement = measure(antenna, see(antenna, image), readings, earlier)
    except (InputError, ValueError) as error:
        return Estimate(Outcome.INVALID, str(error))
    return answer(method, measurement)


def answer(method: Method, measurement: Measurement) -> Estimate:
    """What a method says of a measurement; whatever else it does is the outcome "crashed"."""
    try:
        given: object = method(measurement)
    except (Exception, SystemExit) as error:  # noqa: BLE001 - any failure is a row in the table
        return Estimate(Outcome.CRASHED, f"{type(error).__name__}: {error}")
    if not isinstance(given, Estimate):  # a method of someone else's may return anything
        return Estimate(Outcome.CRASHED, f"returned {type(given).__name__}, not an Estimate")
    return given


def _rest_line(lines: Iterable[Centreline], calibration: Calibration, rig: Rig) -> Rest:
    """Line through the mean of the rest images; its covariance from the points' own scatter.

    The images are averaged column by column first: the centre's error on the pixel grid is the
    same in all of them, so four images do not know the line twice as well as one.
    """
    seen = list(lines)
    pixels = np.vstack([line.points for line in seen])
    columns, place, count = np.unique(pixels[:, 0], return_inverse=True, return_counts=True)
    if len(columns) < LEAST_REST_COLUMNS:
        raise InputError(
            f"the rest images show {len(columns)} columns of the beam, "
            f"needed are {LEAST_REST_COLUMNS}"
        )
    centre = np.bincount(place, pixels[:, 1]) / count
    sigma_v = np.bincount(place, np.concatenate([line.sigma for line in seen])) / count
    down = np.column_stack([np.zeros_like(sigma_v), sigma_v])
    points, vectors = on_plane(calibration.camera, np.column_stack([columns, centre]), down)
    sigma = np.abs(vectors[:, 1])
    x, y = points[:, 0] - rig.base_position[0], points[:, 1]
    design = np.column_stack([np.ones_like(x), x]) / sigma[:, None]
    covariance = np.asarray(np.linalg.inv(design.T @ design), dtype=np.float64)
    y_at_clamp, slope = covariance @ (design.T @ (y / sigma))
    residual = (y - y_at_clamp - slope * x) / sigma
    covariance *= float(np.mean(residual**2)) * correlation_length(residual)
    return Rest(float(y_at_clamp), float(slope), covariance)
