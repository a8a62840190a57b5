"""From images to estimates: calibrate -> centreline -> plane -> method."""

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from solver.calibrate import Calibration, calibrate
from solver.centreline import Centreline
from solver.centreline.area_weighted import area_weighted
from solver.fitting.correlation import correlation_length
from solver.instrument.arrays import Floats, Grey
from solver.instrument.errors import InputError
from solver.instrument.estimate import Estimate, Outcome
from solver.instrument.images import read_grey
from solver.instrument.measurement import Measurement, View
from solver.instrument.observation import Observations
from solver.instrument.rig import Rig
from solver.instrument.transforms import invert
from solver.methods import Method
from solver.plane import on_plane

Extractor = Callable[[Grey], Centreline]

LEAST_REST_COLUMNS = 10
WORST_REPROJECTION_PX = 0.5


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
    image: Grey,
    motor_angle: float | None,
    removed: tuple[float, float] | None = None,
) -> Measurement:
    """The visible beam of a gray image (height, width), in the frame of the beam at rest.

    Points within `removed` [m] along Sigma_a's x axis are left out. Raises InputError if the image
    is not of the calibrated camera's size, or if the motor's angle is not known.
    """
    camera, rig, rest = antenna.calibration.camera, antenna.rig, antenna.rest
    if rig.camera_mount == "world" or motor_angle is None:
        raise InputError(
            "the motor's angle is not told, and finding it from the image of a camera that stands "
            "in the world is not built yet"
        )
    if image.shape != (camera.height, camera.width):
        raise InputError(
            f"the image has {image.shape[1]} x {image.shape[0]} px, "
            f"the calibration {camera.width} x {camera.height}"
        )
    line = antenna.extract(image)
    points, sigma_vectors = on_plane(camera, line.points, line.sigma)
    if removed is not None:
        kept = (points[:, 0] < removed[0]) | (points[:, 0] > removed[1])
        points, sigma_vectors = points[kept], sigma_vectors[kept]
    clamp = np.array([rig.base_position[0], rest.y_at_clamp])
    tilt = math.atan(rest.slope)
    along = np.array([math.cos(tilt), math.sin(tilt)])
    across = np.array([-math.sin(tilt), math.cos(tilt)]) * rig.deflects_towards
    axes = np.column_stack([along, across])
    tolerance = rig.tolerances
    base_covariance = np.zeros((3, 3))
    base_covariance[0, 0] = tolerance.base_position**2 + tolerance.board_translation**2
    base_covariance[1:, 1:] = rest.covariance
    # A nanometre and a nanoradian keep a rig that claims to be exact from being singular.
    base_covariance += np.diag([1e-18, 1e-18, 1e-18])
    # A clamp off plane C, or a board that did not lie in it, is nearer to the camera or farther
    # from it than believed: all lengths err by the same share. A board tilted about its middle
    # is off by its angle times half the beam. The calibration's own scale error, a hundredth of
    # a per cent for a board that fills the view, is neglected.
    height = float(invert(camera.camera_from_antenna)[2, 3])
    tilted = tolerance.board_rotation * rig.beam.length / 2
    off_plane = math.hypot(tolerance.base_position, tolerance.board_translation, tilted)
    scale_sigma = off_plane / height
    if camera.telecentric:  # distance does not change its scale, and tilt but to second order
        scale_sigma = tolerance.board_rotation**2
    antenna_from_beam = np.eye(4)
    antenna_from_beam[:2, :2], antenna_from_beam[:2, 3] = axes, clamp
    viewpoint = invert(antenna_from_beam) @ camera.viewpoint
    return Measurement(
        view=View((points - clamp) @ axes, sigma_vectors @ axes, viewpoint),
        base_covariance=base_covariance,
        scale_sigma=scale_sigma,
        motor_angle=motor_angle,
        rig=rig,
        antenna_from_beam=antenna_from_beam,
    )


def estimate(
    antenna: Antenna,
    image: Grey,
    motor_angle: float | None,
    method: Method,
    removed: tuple[float, float] | None = None,
) -> Estimate:
    """One frame's answer; an error of any kind becomes an outcome, never an exception."""
    try:
        measurement = measure(antenna, image, motor_angle, removed)
    except (InputError, ValueError) as error:
        return Estimate(Outcome.INVALID, str(error))
    try:
        answer: object = method(measurement)
    except (Exception, SystemExit) as error:  # noqa: BLE001 - any failure is a row in the table
        return Estimate(Outcome.CRASHED, f"{type(error).__name__}: {error}")
    if not isinstance(answer, Estimate):  # a method of someone else's may return anything
        return Estimate(Outcome.CRASHED, f"returned {type(answer).__name__}, not an Estimate")
    return answer


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
    points, vectors = on_plane(calibration.camera, np.column_stack([columns, centre]), sigma_v)
    sigma = np.abs(vectors[:, 1])
    x, y = points[:, 0] - rig.base_position[0], points[:, 1]
    design = np.column_stack([np.ones_like(x), x]) / sigma[:, None]
    covariance = np.asarray(np.linalg.inv(design.T @ design), dtype=np.float64)
    y_at_clamp, slope = covariance @ (design.T @ (y / sigma))
    residual = (y - y_at_clamp - slope * x) / sigma
    covariance *= float(np.mean(residual**2)) * correlation_length(residual)
    return Rest(float(y_at_clamp), float(slope), covariance)
