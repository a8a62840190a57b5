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
from solver.instrument.measurement import Measurement
from solver.instrument.observation import Observations
from solver.instrument.rig import Rig
from solver.instrument.transforms import invert
from solver.methods import Method
from solver.plane import on_plane

Extractor = Callable[[Grey], Centreline]


@dataclass(frozen=True)
class Rest:
    """The beam before contact, a line y = offset + slope x on plane C.

    `covariance` (2, 2) is that of (offset at the clamp [m], slope [rad]).
    """

    offset: float
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
    rest = _rest_line(
        (extract(read_grey(path)) for path in observations.rest_images), calibration, rig
    )
    return Antenna(rig, calibration, rest, extract)


def measure(antenna: Antenna, image: Grey, motor_angle: float) -> Measurement:
    """The visible beam of a gray image (height, width), in the frame of the beam at rest.

    Raises InputError if the image is not of the calibrated camera's size.
    """
    camera, rig, rest = antenna.calibration.camera, antenna.rig, antenna.rest
    if image.shape != (camera.height, camera.width):
        raise InputError(
            f"the image has {image.shape[1]} x {image.shape[0]} px, "
            f"the calibration {camera.width} x {camera.height}"
        )
    line = antenna.extract(image)
    points, sigma_vectors = on_plane(camera, line.points, line.sigma)
    clamp_x = float(rig.base_position[0])
    clamp = np.array([clamp_x, rest.offset + rest.slope * clamp_x])
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
    height = float(invert(camera.camera_from_antenna)[2, 3])
    off_plane = math.hypot(tolerance.base_position, tolerance.board_translation)
    return Measurement(
        points=(points - clamp) @ axes,
        sigma_vectors=sigma_vectors @ axes,
        base_covariance=base_covariance,
        scale_sigma=off_plane / height,
        motor_angle=motor_angle,
        rig=rig,
    )


def estimate(antenna: Antenna, image: Grey, motor_angle: float, method: Method) -> Estimate:
    """One frame's answer; an error of any kind becomes an outcome, never an exception."""
    try:
        measurement = measure(antenna, image, motor_angle)
    except (InputError, ValueError) as error:
        return Estimate(Outcome.INVALID, str(error))
    try:
        answer: object = method(measurement)
    except Exception as error:  # noqa: BLE001 - any failure of a method is a row in the table
        return Estimate(Outcome.CRASHED, f"{type(error).__name__}: {error}")
    if not isinstance(answer, Estimate):  # a method of someone else's may return anything
        return Estimate(Outcome.CRASHED, f"returned {type(answer).__name__}, not an Estimate")
    return answer


def _rest_line(lines: Iterable[Centreline], calibration: Calibration, rig: Rig) -> Rest:
    """Weighted line through all rest images' points; its covariance from their own scatter."""
    on_c = [on_plane(calibration.camera, line.points, line.sigma) for line in lines]
    points = np.vstack([points for points, _ in on_c])
    sigma = np.abs(np.vstack([vectors for _, vectors in on_c])[:, 1])
    if len(points) < 10:
        raise InputError(f"the rest images show {len(points)} columns of the beam, needed are 10")
    clamp_x = float(rig.base_position[0])
    x, y = points[:, 0] - clamp_x, points[:, 1]
    design = np.column_stack([np.ones_like(x), x]) / sigma[:, None]
    covariance = np.asarray(np.linalg.inv(design.T @ design), dtype=np.float64)
    at_clamp, slope = covariance @ (design.T @ (y / sigma))
    residual = (y - at_clamp - slope * x) / sigma
    covariance *= float(np.mean(residual**2)) * correlation_length(residual)
    return Rest(float(at_clamp - slope * clamp_x), float(slope), covariance)
