"""Calibration of plane C from one view of the board in it: the homography, as in the paper.

One view of a plane determines the map from pixels to that plane, but hardly the camera's position:
focal length and height are strongly correlated. Measurements in plane C are not affected; methods
that need the viewpoint must not rely on it.
"""

from typing import Any, Final

import numpy as np
from scipy.optimize import least_squares

from solver.calibrate.board_detection import BoardDetection
from solver.calibrate.calibration import Calibration
from solver.calibrate.pinhole import Bundle
from solver.instrument.arrays import Floats
from solver.instrument.camera import Camera
from solver.instrument.rig import Rig
from solver.instrument.transforms import invert, rigid

# Prior of an unknown lens, one sigma over the image's width: its focal length about the width, its
# axis about the middle. One sigma weighs as much as an error of _BELIEF_PX.
FOCAL_SHARE, AXIS_SHARE = 0.5, 0.05
_BELIEF_PX: Final = 0.02


def plane_alone(lying: BoardDetection, width: int, height: int, rig: Rig) -> Calibration:
    """Calibrate a camera with square pixels that reproduces the board of view 0.

    Its map of plane C is that of the best homography; its viewpoint is not known.
    """
    bundle = Bundle(rig.board, [lying], 0)
    believed = np.array([width, (width - 1) / 2, (height - 1) / 2])
    sigma = width * np.array([FOCAL_SHARE, AXIS_SHARE, AXIS_SHARE])

    def residuals(values: Floats) -> Floats:
        known = _BELIEF_PX * (values[:3] - believed) / sigma
        return np.concatenate([bundle.residuals(values), known])

    def jacobian(values: Floats) -> Floats:
        known = np.zeros((3, len(values)))
        known[:, :3] = np.diag(_BELIEF_PX / sigma)
        return np.vstack([bundle.jacobian(values), known])

    start = np.concatenate([believed, bundle.posed(believed)])
    found: Any = least_squares(residuals, start, jacobian, method="lm", x_scale="jac")
    focal, cx, cy = (float(v) for v in found.x[:3])
    pose = rigid(*bundle.pose(found.x, 0)) @ invert(rig.antenna_from_board)
    camera = Camera(width, height, focal, focal, cx, cy, pose)
    left = found.fun[: 2 * len(lying)]
    reprojection = float(np.sqrt(left @ left / len(lying)))
    return Calibration(camera, reprojection, bundle.covariance(found), viewpoint_known=False)
