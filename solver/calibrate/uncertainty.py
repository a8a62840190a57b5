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
    places = rig.base_position + np.column_stack([x, np.zeros_like(x), np.zeros_like(x)])
    shown = camera.shows(places)
    x, places = x[shown], places[shown]
    pixels = camera.project(places)
    # The line through the errors along the beam: its value at the clamp, and its slope.
    line = np.linalg.pinv(np.column_stack([np.ones_like(x), x]))
    sigma = np.sqrt(np.diag(calibration.covariance))
    slopes = np.empty((4, len(sigma)))
    # Steps are small enough to be linear: parameters are jointly more certain than each alone.
    for i, step in enumerate(1e-3 * sigma):
        moved = np.zeros_like(sigma)
        moved[i] = step
        seen, _ = on_plane(_moved(camera, moved, rig), pixels, np.zeros_like(pixels))
        slopes[:2, i] = line @ (seen[:, 0] - places[:, 0]) / (step or 1.0)
        slopes[2:, i] = line @ (seen[:, 1] - places[:, 1]) / (step or 1.0)
    variance = np.diag(slopes @ calibration.covariance @ slopes.T)
    return CalibrationUncertainty(*(float(value) for value in np.sqrt(np.maximum(variance, 0.0))))


def _moved(camera: Camera, change: Floats, rig: Rig) -> Camera:
    """Return the camera with changed parameters, in the order of Calibration.covariance."""
    lens = len(camera.distortion)
    camera_from_board = camera.camera_from_antenna @ rig.antenna_from_board
    turn, shift = change[3 + lens : 6 + lens], change[6 + lens :]
    turned = rigid(turn, np.zeros(3)) @ camera_from_board
    turned[:3, 3] = camera_from_board[:3, 3] + shift
    return replace(
        camera,
        fx=camera.fx + change[0],
        fy=camera.fy + change[0],
        cx=camera.cx + change[1],
        cy=camera.cy + change[2],
        distortion=tuple(np.asarray(camera.distortion) + change[3 : 3 + lens]),
        camera_from_antenna=turned @ invert(rig.antenna_from_board),
    )
