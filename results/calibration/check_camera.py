"""Round trip of the camera: render calibration images, calibrate, compare with the truth.

Errors are compared with the calibration's own covariance: with few views or much noise, a correct
calibration is as far off as that states.
"""

from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any, Final

import numpy as np

from solver.calibrate import Calibration, calibrate
from solver.calibrate.uncertainty import plane_jacobian
from solver.instrument.arrays import Floats
from solver.instrument.camera import Camera
from solver.instrument.rig import Rig
from solver.instrument.transforms import rotation_vector
from solver.instrument.units import MILLIMETRE, PERCENT
from solver.planes.plane_c import on_plane
from vbaa_bench.benchmarks.budget.true_world import with_nominal_board
from vbaa_bench.generation.frame_renderer import FrameRenderer
from vbaa_bench.scene.load import SceneFile
from vbaa_bench.scene.rigs import nominal_rig, true_rig

# Largest error in sigmas of the calibration. Derived: noise alone exceeds it once in 25 million
# for a number, and once in 4 million for a point in the plane; all numbers, and the 30 or fewer
# points of the field that are independent, together exceed it in one calibration of 100 000.
MAX_SIGMAS: Final = 5.5
# A telecentric camera has no covariance.
POINTS_MM: Final = 0.01
MAGNIFICATION_PCT: Final = 0.03
# Region of plane C over which the beam may move, over its length: its visible part is checked.
_FIELD: Final = ((0.0, 1.0), (-0.05, 0.25))


@dataclass(frozen=True)
class Check:
    """One quantity of the camera: its error and its largest allowed error."""

    quantity: str
    error: float
    allowed: float
    unit: str

    @property
    def passed(self) -> bool:
        """Whether the error is within the allowed one."""
        return self.error <= self.allowed


def check_camera(
    file: SceneFile, variant: str, progress: Callable[[int, int], None] = lambda _done, _total: None
) -> tuple[list[Check], Calibration]:
    """Render a scene's calibration images, calibrate from them, and compare with the true camera.

    Raises InputError if the images do not allow a calibration.
    """
    scene, views = file.scene, file.scene.calibration.views
    rig, nominal = true_rig(scene), nominal_rig(scene)
    renderer = FrameRenderer(scene, rig, file.folder.resolve(), variant, threads=0)
    exposure = renderer.measure_exposure()
    images = []
    for view in range(views):
        images.append(renderer.board_image(view, exposure))
        progress(view + 1, views)
    calibration = calibrate(images, nominal)
    return compare(
        calibration, with_nominal_board(rig, nominal.antenna_from_board), nominal
    ), calibration


def compare(calibration: Calibration, true: Camera, nominal: Rig) -> list[Check]:
    """Compare a calibration with the true camera, whose board is where the rig states it."""
    estimated = calibration.camera
    points = _field(true, nominal.beam.length)
    pixels = true.project(points)
    estimates, _ = on_plane(estimated, pixels, np.zeros_like(pixels))
    errors = estimates - points[:, :2]
    if true.telecentric:  # no principal point, and only two of the pose's six numbers
        distance = float(np.linalg.norm(errors, axis=1).max())
        scale_error = abs(estimated.fx / true.fx - 1)
        return [
            Check("points on plane C", distance / MILLIMETRE, POINTS_MM, "mm"),
            Check("magnification", scale_error / PERCENT, MAGNIFICATION_PCT, "%"),
        ]
    covariance = calibration.covariance
    assert covariance is not None
    sigma = np.sqrt(np.diag(covariance))
    board = nominal.antenna_from_board
    pose = _pose_error(estimated.camera_from_antenna @ board, true.camera_from_antenna @ board)
    lens = np.array([estimated.fx - true.fx, estimated.cx - true.cx, estimated.cy - true.cy])
    checks = (
        ("points on plane C", _point_sigmas(errors, pixels, calibration, nominal)),
        ("focal length", lens[:1] / sigma[:1]),
        ("principal point", lens[1:] / sigma[1:3]),
        ("pose", pose / sigma[-6:]),
    )
    return [
        Check(quantity, float(np.abs(sigmas).max()), MAX_SIGMAS, "sigma")
        for quantity, sigmas in checks
    ]


def record(checks: list[Check], calibration: Calibration) -> dict[str, Any]:
    """Convert checks and calibration to a record for scripts."""
    return {
        "checks": [asdict(check) | {"passed": check.passed} for check in checks],
        "passed": all(check.passed for check in checks),
        "reprojection_px": calibration.reprojection_px,
    }


def _field(camera: Camera, length: float) -> Floats:
    """Return points (n, 3) [m] on plane C over which the beam moves, in the camera's view."""
    x, y = (np.linspace(*limits, 25) * length for limits in _FIELD)
    x_grid, y_grid = np.meshgrid(x, y)
    points = np.column_stack([x_grid.ravel(), y_grid.ravel(), np.zeros(x_grid.size)])
    pixels = camera.project(points)
    inside = (pixels >= 0) & (pixels <= [camera.width - 1, camera.height - 1])
    return np.asarray(points[inside.all(axis=1)])


def _point_sigmas(errors: Floats, pixels: Floats, calibration: Calibration, nominal: Rig) -> Floats:
    """Compute the Mahalanobis distances (n,) of the errors (n, 2) [m] of points on plane C."""
    assert calibration.covariance is not None
    jacobian = plane_jacobian(calibration, nominal, pixels)
    covariance = jacobian @ calibration.covariance @ jacobian.transpose(0, 2, 1)
    weighted = np.linalg.solve(covariance, errors[..., None])[..., 0]
    return np.asarray(np.sqrt((errors * weighted).sum(axis=1)))


def _pose_error(estimated: Floats, true: Floats) -> Floats:
    """Compute rotation [rad] and shift [m] (6,) between two poses of the board in view 0."""
    rotation = np.eye(4)
    rotation[:3, :3] = estimated[:3, :3] @ true[:3, :3].T
    return np.concatenate([rotation_vector(rotation), estimated[:3, 3] - true[:3, 3]])
