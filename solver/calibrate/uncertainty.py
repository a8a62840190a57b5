"""Uncertainty of the beam on plane C, propagated from the calibration's covariance."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from solver.calibrate.calibration import Calibration
from solver.instrument.arrays import Floats
from solver.instrument.camera import Camera
from solver.instrument.rig import Rig
from solver.instrument.transforms import invert, rigid
from solver.planes.plane_c import on_plane


class CalibrationUncertainty(NamedTuple):
    """One-sigma errors of a calibration on plane C.

    Along the beam: `clamp` of a place at the clamp [m], `scale` of lengths, relative. Across it:
    `across` of a place at the clamp [m], `turn` of directions [rad]; the rest images
    remove these two.
    """

    clamp: float
    scale: float
    across: float
    turn: float


def calibration_uncertainty(calibration: Calibration, rig: Rig) -> CalibrationUncertainty:
    """Propagate a calibration's covariance to the beam on plane C; zero where it has none."""
    if calibration.covariance is None:
        return CalibrationUncertainty(0.0, 0.0, 0.0, 0.0)
    camera = calibration.camera
    x = rig.beam.length * np.linspace(0.05, 0.95, 10)
    points = rig.base_position + np.column_stack([x, np.zeros_like(x), np.zeros_like(x)])
    visible = camera.shows(points)
    x, points = x[visible], points[visible]
    pixels = camera.project(points)
    # The line through the errors along the beam: its value at the clamp, and its slope.
    line = np.linalg.pinv(np.column_stack([np.ones_like(x), x]))
    by_parameters = plane_jacobian(calibration, rig, pixels)
    jacobian = np.vstack([line @ by_parameters[:, 0], line @ by_parameters[:, 1]])
    variance = np.diag(jacobian @ calibration.covariance @ jacobian.T)
    return CalibrationUncertainty(*(float(value) for value in np.sqrt(np.maximum(variance, 0.0))))


def plane_jacobian(calibration: Calibration, rig: Rig, pixels: Floats) -> Floats:
    """Differentiate the points on plane C of pixels (n, 2) by the k parameters of the covariance.

    Return x and y of each point (n, 2, k), in metres over the parameters' units.
    """
    assert calibration.covariance is not None
    camera, straight = calibration.camera, np.zeros_like(pixels)
    at, _ = on_plane(camera, pixels, straight)
    # Steps are small enough to be linear: parameters are jointly more certain than each alone.
    steps = 1e-3 * np.sqrt(np.diag(calibration.covariance))
    changes = [
        on_plane(_changed_camera(camera, change, rig), pixels, straight)[0] - at
        for change in np.diag(steps)
    ]
    return np.asarray(np.stack(changes, axis=-1) / np.where(steps > 0, steps, 1.0))


def _changed_camera(camera: Camera, change: Floats, rig: Rig) -> Camera:
    """Return the camera with parameters changed by (n,), in the order of Calibration.covariance."""
    n = len(camera.distortion)
    camera_from_board = camera.camera_from_antenna @ rig.antenna_from_board
    rotation, shift = change[3 + n : 6 + n], change[6 + n :]
    changed_pose = rigid(rotation, np.zeros(3)) @ camera_from_board
    changed_pose[:3, 3] = camera_from_board[:3, 3] + shift
    return replace(
        camera,
        fx=camera.fx + change[0],
        fy=camera.fy + change[0],
        cx=camera.cx + change[1],
        cy=camera.cy + change[2],
        distortion=tuple(np.asarray(camera.distortion) + change[3 : 3 + n]),
        camera_from_antenna=changed_pose @ invert(rig.antenna_from_board),
    )
