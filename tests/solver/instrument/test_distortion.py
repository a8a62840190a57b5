import cv2
import numpy as np
import pytest

from solver.instrument.arrays import Floats
from solver.instrument.camera import Camera
from solver.instrument.distortion import distort, one_to_one, undistort
from solver.instrument.transforms import camera_looking_at
from tests.draws import generator

BARREL = (-0.25, 0.1, 0.001, -0.0007, -0.02)
RATIONAL = (0.1, 0.02, -0.001, 0.0008, 0.005, 0.28, 0.03, 0.01)
LENSES = pytest.mark.parametrize("lens", [(), BARREL, RATIONAL], ids=["none", "five", "eight"])


def camera(lens: tuple[float, ...]) -> Camera:
    pose = camera_looking_at(np.array([0.12, 0.02, 0.36]), np.array([0.125, 0.01, 0.0]), 0.02)
    return Camera(512, 400, 700, 700, 250.0, 205.0, pose, distortion=lens)


def field() -> Floats:
    """Normalised points out to a half angle of 30 degrees."""
    return generator(__name__, 0).uniform(-0.4, 0.4, (200, 2))


@LENSES
def test_pixels_are_opencvs(lens: tuple[float, ...], random: np.random.Generator) -> None:
    one, coefficients = camera(lens), np.array(lens or (0.0,) * 5)
    points = random.uniform([0, -0.1, -0.02], [0.24, 0.1, 0.02], (200, 3))
    rotation, _ = cv2.Rodrigues(one.camera_from_antenna[:3, :3])
    shift = one.camera_from_antenna[:3, 3]
    expected, _ = cv2.projectPoints(points, rotation, shift, one.matrix, coefficients)
    pixels = one.project(points)
    assert pixels == pytest.approx(expected.reshape(-1, 2), abs=1e-9)
    tight = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 200, 1e-15)
    ideal = cv2.undistortPoints(
        pixels.reshape(-1, 1, 2), one.matrix, coefficients, P=one.matrix, criteria=tight
    )
    assert one.undistorted_pixels(pixels) == pytest.approx(ideal.reshape(-1, 2), abs=1e-9)


@LENSES
def test_undistortion_is_the_inverse_of_distortion(lens: tuple[float, ...]) -> None:
    distorted, _ = distort(field(), lens)
    assert np.abs(undistort(distorted, lens) - field()).max() < 1e-12


@LENSES
def test_the_jacobian_is_the_derivative(lens: tuple[float, ...]) -> None:
    _, jacobian = distort(field(), lens)
    for axis, step in enumerate(np.eye(2) * 1e-5):
        ahead, behind = (distort(field() + sign * step, lens)[0] for sign in (1, -1))
        assert jacobian[:, :, axis] == pytest.approx((ahead - behind) / 2e-5, abs=1e-9)


def test_a_lens_that_folds_the_image_is_found_out() -> None:
    # 1 - 3 k r^2 of r (1 - k r^2) is zero at r = 0.408, where the image is 0.272 away.
    lens = (-2.0, 0.0, 0.0, 0.0, 0.0)
    rim = np.array([[0.27, 0.0], [0.0, -0.2]])
    assert one_to_one(rim, lens)
    assert not one_to_one(rim * 1.02, lens)
    # What lies beyond is nowhere; what lies within is found beside it.
    found = undistort(np.vstack([rim[:1] * 1.02, rim]), lens)
    assert np.isnan(found[0]).all()
    assert distort(found[1:], lens)[0] == pytest.approx(rim, abs=1e-12)


def test_no_point_is_found_on_a_side_folded_over() -> None:
    # r (1 - r^2 / 4) falls from 0.7698 at r = 1.155 and is -0.93 at 2.36, where the Jacobian's
    # determinant is positive again.
    lens = (-0.25, 0.0, 0.0, 0.0, 0.0)
    assert np.isnan(undistort(np.array([[0.93, 0.0], [0.0, -0.78]]), lens)).all()
    assert undistort(np.array([[0.769, 0.0]]), lens)[0, 0] < 1.1547


@pytest.mark.thorough
@pytest.mark.parametrize("count", [5, 8])
def test_points_are_found_up_to_the_fold_of_any_lens(count: int) -> None:
    random = generator(__name__, count)
    size = np.array([0.4, 0.3, 0.005, 0.005, 0.2, 0.3, 0.2, 0.1])[:count]
    folded = 0
    for _ in range(40):
        lens = tuple(float(value) for value in size * random.standard_normal(count))
        # Along many rays, up to where OpenCV's model turns back on one of them.
        radii, turns = np.linspace(0, 1.2, 241), np.linspace(0, 2 * np.pi, 24, endpoint=False)
        rays = np.column_stack([np.cos(turns), np.sin(turns)])
        points = (radii[:, None, None] * rays).reshape(-1, 2)
        ahead = np.column_stack([points, np.ones(len(points))])
        shown, _ = cv2.projectPoints(ahead, np.zeros(3), np.zeros(3), np.eye(3), np.array(lens))
        climb = np.diff((shown.reshape(241, 24, 2) * rays).sum(axis=2), axis=0).min(axis=1)
        stop = len(radii) - 1 if (climb > 0).all() else int(np.argmax(climb <= 0))
        folded += stop < len(radii) - 1
        inner = 24 * max(stop - 2, 1)
        found = undistort(shown.reshape(-1, 2)[:inner].astype(np.float64), lens)
        assert found == pytest.approx(points[:inner], abs=1e-6), lens
    assert folded > 3  # not only harmless lenses


def test_a_lens_folded_between_axis_and_rim_is_found_out() -> None:
    # It falls between r = 0.27 and 0.5 and rises again, to reach the rim with a positive slope.
    lens = (-5.0, 11.0, 0.0, 0.0, 0.0)
    assert not one_to_one(np.array([[0.9, 0.0]]), lens)


def test_what_is_no_distortion_is_refused() -> None:
    with pytest.raises(ValueError, match="allowed are 0, 5 or 8"):
        camera((0.1, 0.2))
    with pytest.raises(ValueError, match="finite"):
        camera((float("nan"),) * 5)
    with pytest.raises(ValueError, match="not for a telecentric"):
        Camera(32, 32, 1e4, 1e4, 16, 16, np.eye(4), telecentric=True, distortion=BARREL)
