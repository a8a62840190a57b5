"""Calibration of plane C from one view of the board in it: the homography, as in the paper.

One view of a plane determines the map from pixels to that plane, but hardly the camera's position:
focal length and height are strongly correlated. Measurements in plane C are not affected; methods
that need the viewpoint must not rely on it.
"""

from typing import Any, Final

import numpy as np
from scipy.optimize import least_squares

from solver.calibrate.board_detection import BoardDetection
from solver.calibrate.calibration import Calibration, determined
from solver.calibrate.pinhole import Bundle
from solver.instrument.arrays import Floats
from solver.instrument.camera import Camera
from solver.instrument.rig import Rig
from solver.instrument.transforms import invert, rigid

# Prior of an unknown lens, one sigma over the image's width: its focal length about the width, its
# axis about the middle. One sigma weighs as much as an error of _PRIOR_PX.
FOCAL_SIGMA, AXIS_SIGMA = 0.5, 0.05
_PRIOR_PX: Final = 0.02


def plane_alone(lying: BoardDetection, width: int, height: int, rig: Rig) -> Calibration:
    """Calibrate a camera with square pixels that reproduces the board of view 0.

    Its map of plane C is that of the best homography; its viewpoint is not known. Raises
    InputError if the view does not determine the map.
    """
    bundle = Bundle(rig.board, [lying], 0)
    prior_mean = np.array([width, (width - 1) / 2, (height - 1) / 2])
    sigma = width * np.array([FOCAL_SIGMA, AXIS_SIGMA, AXIS_SIGMA])

    def residuals(values: Floats) -> Floats:
        prior = _PRIOR_PX * (values[:3] - prior_mean) / sigma
        return np.concatenate([bundle.residuals(values), prior])

    def jacobian(values: Floats) -> Floats:
        prior = np.zeros((3, len(values)))
        prior[:, :3] = np.diag(_PRIOR_PX / sigma)
        return np.vstack([bundle.jacobian(values), prior])

    start = determined(np.concatenate([prior_mean, bundle.posed(prior_mean)]))
    fit: Any = least_squares(residuals, start, jacobian, method="lm", x_scale="jac")
    focal, cx, cy = (float(v) for v in fit.x[:3])
    pose = rigid(*bundle.pose(fit.x, 0)) @ invert(rig.antenna_from_board)
    camera = Camera(width, height, focal, focal, cx, cy, pose)
    point_errors = fit.fun[: 2 * len(lying)]
    reprojection = float(np.sqrt(point_errors @ point_errors / len(lying)))
    return Calibration(camera, reprojection, bundle.covariance(fit), viewpoint_known=False)
