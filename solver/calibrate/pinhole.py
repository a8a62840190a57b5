"""Calibrate a pinhole camera: from several views of the board, or plane C from view 0 alone."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from solver.calibrate.board_detection import BoardDetection
from solver.calibrate.bundle import Bundle, LensPrior
from solver.calibrate.calibration import Calibration, Stretch
from solver.calibrate.thresholds import THRESHOLDS
from solver.core.least_squares import NormalEquations
from solver.instrument.arrays import Floats
from solver.instrument.errors import InputError
from solver.instrument.rig import Rig

# Sigma of the distortion's coefficients, which are of the order of one. Without a prior a rational
# lens's k1 and k4 may diverge together, nearly cancelling each other.
_COEFFICIENT_SIGMA: Final = 1.0
# Prior of an unknown lens, one sigma over the image's width: its focal length about the width, its
# axis about the middle.
FOCAL_SIGMA, AXIS_SIGMA = 0.5, 0.05
# Steps of the board's stretch, each with a new fit, and their largest size, up to which they are
# nearly linear. Chosen.
_STRETCH_STEPS, _LARGEST_STRETCH_STEP = 5, 0.02


def pinhole(seen: Sequence[BoardDetection], width: int, height: int, rig: Rig) -> Calibration:
    """Calibrate a camera with square pixels from several views of the rig's board, view 0 first.

    The start is Zhang's (2000). Every point has the same weight, and those with an error of
    THRESHOLDS.outlier_ratio times the median are left out. Raises InputError if there are fewer
    than three views, or if they do not determine the camera.
    """
    if len(seen) < THRESHOLDS.min_views:
        raise InputError(
            f"{len(seen)} calibration views show enough of the board, needed are "
            f"{THRESHOLDS.min_views}; a single view works with 0 camera.distortion_coefficients, "
            "as in the paper"
        )
    coefficients = rig.distortion_coefficients
    sigma = np.append(np.full(3, np.inf), np.full(coefficients, _COEFFICIENT_SIGMA))
    bundle = Bundle(rig.board, seen, LensPrior(np.zeros(3 + coefficients), sigma))
    at = bundle.fit(bundle.start(width, height))
    inliers = _without_outliers(seen, bundle.errors(at))
    if sum(map(len, inliers)) < sum(map(len, seen)):
        bundle = replace(bundle, seen=inliers)
        at = bundle.fit(bundle.start(width, height))
    calibration = bundle.calibration(at, width, height, rig)
    return replace(calibration, stretch=_stretch(bundle, at, width, height))


def plane_alone(lying: BoardDetection, width: int, height: int, rig: Rig) -> Calibration:
    """Calibrate a camera with square pixels that reproduces the board of view 0, as in the paper.

    One view of a plane determines the map from pixels to that plane, that of the best homography,
    but hardly the camera's position: focal length and height are strongly correlated. Measurements
    in plane C are not affected; methods that need the viewpoint must not rely on it. Raises
    InputError if the view does not determine the map.
    """
    mean = np.array([width, (width - 1) / 2, (height - 1) / 2])
    sigma = width * np.array([FOCAL_SIGMA, AXIS_SIGMA, AXIS_SIGMA])
    bundle = Bundle(rig.board, [lying], LensPrior(mean, sigma))
    at = bundle.fit(bundle.start_from_prior())
    return replace(bundle.calibration(at, width, height, rig), viewpoint_known=False)


def _stretch(bundle: Bundle, at: NormalEquations, width: int, height: int) -> Stretch:
    """Estimate how much taller than wide the board is printed, which the model leaves out.

    The first step is linear; where it is significant, the camera is fitted anew for each next step.
    """
    step, total = bundle.stretch(at), 0.0
    for _ in range(_STRETCH_STEPS):
        if not step.is_significant:
            break
        total += min(max(step.value, -_LARGEST_STRETCH_STEP), _LARGEST_STRETCH_STEP)
        stretched = replace(bundle, stretched=total)
        step = stretched.stretch(stretched.fit(stretched.start(width, height)))
    return Stretch(total + step.value, step.sigma)


def _without_outliers(detections: Sequence[BoardDetection], errors: Floats) -> list[BoardDetection]:
    """Remove points whose error (n, 2) [px] exceeds THRESHOLDS.outlier_ratio times the median."""
    sizes = np.linalg.norm(errors, axis=1)
    # At least a hundredth of a pixel: points without noise err by rounding alone.
    inlier = sizes <= THRESHOLDS.outlier_ratio * max(float(np.median(sizes)), 0.01)
    masks = np.split(inlier, np.cumsum([len(detection) for detection in detections])[:-1])
    return [
        BoardDetection(detection.numbers[mask], detection.pixels[mask])
        for detection, mask in zip(detections, masks, strict=True)
    ]
