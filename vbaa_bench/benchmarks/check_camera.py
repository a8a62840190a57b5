"""Round trip of the camera: render calibration images, calibrate, compare with the truth."""

from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from typing import Any, Final

import numpy as np

from solver.calibrate import Calibration, calibrate
from solver.instrument.arrays import Floats
from solver.instrument.camera import Camera
from solver.instrument.rig import Rig
from solver.instrument.transforms import invert, rotation_vector
from solver.instrument.units import MILLIMETRE, PERCENT
from solver.planes.plane_c import on_plane
from vbaa_bench.generation.frame_renderer import FrameRenderer
from vbaa_bench.scene.load import SceneFile
from vbaa_bench.scene.rigs import TrueRig, nominal_rig, true_rig

POINTS_MM: Final = 0.01
FOCAL_LENGTH_PCT: Final = 0.03
PRINCIPAL_POINT_PX: Final = 0.2
# Decentring distortion and the principal point shift the image almost equally.
PRINCIPAL_POINT_DISTORTED_PX: Final = 0.3
POSE_SIGMAS: Final = 3.0
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
    estimates, _ = on_plane(estimated, true.project(points), np.zeros((len(points), 2)))
    max_distance = float(np.linalg.norm(estimates - points[:, :2], axis=1).max())
    scale_error = abs(estimated.fx / true.fx - 1)
    checks = [Check("points on plane C", max_distance / MILLIMETRE, POINTS_MM, "mm")]
    if true.telecentric:  # no principal point, and only two of the pose's six numbers
        return [*checks, Check("magnification", scale_error / PERCENT, FOCAL_LENGTH_PCT, "%")]
    allowed = PRINCIPAL_POINT_DISTORTED_PX if true.distortion else PRINCIPAL_POINT_PX
    shift = float(np.hypot(estimated.cx - true.cx, estimated.cy - true.cy))
    board = nominal.antenna_from_board
    sigmas = _pose_sigmas(calibration, true.camera_from_antenna @ board, board)
    return [
        *checks,
        Check("focal length", scale_error / PERCENT, FOCAL_LENGTH_PCT, "%"),
        Check("principal point", shift, allowed, "px"),
        Check("pose", sigmas, POSE_SIGMAS, "sigma"),
    ]


def record(checks: list[Check], calibration: Calibration) -> dict[str, Any]:
    """Convert checks and calibration to a record for scripts."""
    return {
        "checks": [asdict(check) | {"passed": check.passed} for check in checks],
        "passed": all(check.passed for check in checks),
        "reprojection_px": calibration.reprojection_px,
    }


def with_nominal_board(rig: TrueRig, antenna_from_board: Floats) -> Camera:
    """Return the true camera relative to the board, assumed at its nominal pose.

    The board's displacement is the laboratory's error, with a tolerance of its own.
    """
    true = rig.camera
    pose = true.camera_from_antenna @ rig.antenna_from_board @ invert(antenna_from_board)
    return replace(true, camera_from_antenna=pose)


def _field(camera: Camera, length: float) -> Floats:
    """Return points (n, 3) [m] on plane C over which the beam moves, in the camera's view."""
    x, y = (np.linspace(*limits, 25) * length for limits in _FIELD)
    x_grid, y_grid = np.meshgrid(x, y)
    points = np.column_stack([x_grid.ravel(), y_grid.ravel(), np.zeros(x_grid.size)])
    pixels = camera.project(points)
    inside = (pixels >= 0) & (pixels <= [camera.width - 1, camera.height - 1])
    return np.asarray(points[inside.all(axis=1)])


def _pose_sigmas(calibration: Calibration, true: Floats, antenna_from_board: Floats) -> float:
    """Compute the largest error of the six numbers of view 0's pose, in their stated sigmas."""
    assert calibration.covariance is not None
    estimated = calibration.camera.camera_from_antenna @ antenna_from_board
    rotation = np.eye(4)
    rotation[:3, :3] = estimated[:3, :3] @ true[:3, :3].T
    error = np.concatenate([rotation_vector(rotation), estimated[:3, 3] - true[:3, 3]])
    return float(np.abs(error / np.sqrt(np.diag(calibration.covariance)[-6:])).max())
