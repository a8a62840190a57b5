import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from solver.instrument.estimate import Estimate, Outcome
from solver.planes.plane_d import known_plane, on_deformation_plane, unproject
from tests.inclined import inclined, on_plane_c

POINTS = np.column_stack([np.linspace(0.01, 0.24, 30), 2 * np.linspace(0.01, 0.24, 30) ** 2])
PINHOLE = np.array([0.1, 0.03, 0.4, 1.0])
TELECENTRIC = np.array([0.1, -0.2, 0.9, 0.0])
VIEWPOINTS = [PINHOLE, TELECENTRIC]


@given(
    st.floats(-1.4, 1.4),
    st.floats(-0.2, 0.3),
    st.floats(-0.1, 0.1),
    st.floats(0.2, 2.0),
    st.sampled_from([0.0, 1.0]),
)
def test_un_projection_undoes_the_projection(
    psi: float, x: float, y: float, z: float, w: float
) -> None:
    viewpoint = np.array([x, y, z, w])
    if abs(z * np.cos(psi) - y * np.sin(psi)) < 0.1 * np.hypot(y, z):
        return
    # No point of D may lie beside or behind the camera.
    if w and (POINTS[:, 1].max() * abs(np.sin(psi)) > 0.8 * z):
        return
    on_c = on_plane_c(POINTS, psi, viewpoint)
    found, _, _ = unproject(on_c, viewpoint, psi)
    assert found == pytest.approx(POINTS, abs=1e-12)


def test_equals_the_printed_equations() -> None:
    psi, (x_v, y_v, z_v, _) = 0.5, PINHOLE
    x_m, y_m = POINTS.T
    denominator = z_v * np.cos(psi) + (y_m - y_v) * np.sin(psi)
    printed = np.column_stack(  # (7) and (8)
        [x_m - y_m * (x_m - x_v) * np.sin(psi) / denominator, z_v * y_m / denominator]
    )
    assert unproject(POINTS, PINHOLE, psi)[0] == pytest.approx(printed, rel=1e-13)


@pytest.mark.parametrize("viewpoint", VIEWPOINTS)
def test_a_far_pinhole_becomes_telecentric(viewpoint: np.ndarray) -> None:
    direction = viewpoint[:3]
    far = np.append(direction * 1e7, 1.0)
    parallel = np.append(direction, 0.0)
    assert unproject(POINTS, far, 0.7)[0] == pytest.approx(
        unproject(POINTS, parallel, 0.7)[0], abs=1e-8
    )


@pytest.mark.parametrize("viewpoint", VIEWPOINTS)
@pytest.mark.parametrize("psi", [-1.0, 0.0, 0.6])
def test_its_derivatives_are_those_of_small_steps(viewpoint: np.ndarray, psi: float) -> None:
    _, by_point, by_psi = unproject(POINTS, viewpoint, psi)
    h = 1e-6
    for axis in (0, 1):
        step = np.eye(2)[axis] * h
        ahead, behind = (unproject(POINTS + s, viewpoint, psi)[0] for s in (step, -step))
        assert by_point[:, :, axis] == pytest.approx((ahead - behind) / (2 * h), abs=1e-8)
    ahead, behind = (unproject(POINTS, viewpoint, psi + s)[0] for s in (h, -h))
    assert by_psi == pytest.approx((ahead - behind) / (2 * h), abs=1e-8)


def test_the_plane_takes_the_place_of_c() -> None:
    psi = 0.7
    seen = inclined(on_plane_c(POINTS, psi, PINHOLE), 1e-5, viewpoint=PINHOLE, base_sigma=1e-5)
    planar = on_deformation_plane(seen, psi)
    assert planar is not None
    assert planar.points == pytest.approx(POINTS, abs=1e-12)
    # Its points and the viewpoint are the same points of space as before.
    pose = planar.antenna_from_beam
    there = planar.points @ pose[:2, :2].T
    assert there[:, 1] == pytest.approx(POINTS[:, 1] * np.cos(psi), abs=1e-12)
    assert pose[:3, :3] @ planar.view.viewpoint[:3] == pytest.approx(PINHOLE[:3])
    # A clamp displaced along y is displaced by what the ray at the clamp makes of it.
    step = 1e-7
    moved, _, _ = unproject(np.array([[0.0, step]]), PINHOLE, psi)
    assert planar.base_covariance[1, 1] == pytest.approx((moved[0, 1] / step * 1e-5) ** 2, rel=1e-5)
    assert on_deformation_plane(seen, 0.0) is seen


def test_a_plane_seen_edge_on_is_refused() -> None:
    edge_on = float(np.arctan2(PINHOLE[2], PINHOLE[1]))
    seen = inclined(POINTS, 1e-5, viewpoint=PINHOLE, known_psi=edge_on - 0.01)
    answer = known_plane(seen)
    assert isinstance(answer, Estimate)
    assert answer.outcome is Outcome.EDGE_ON
    assert on_deformation_plane(seen, edge_on) is None


def test_rays_that_meet_the_plane_behind_the_camera_are_left_out() -> None:
    near = np.array([0.1, -0.05, 0.05, 1.0])
    seen = inclined(np.array([[0.1, 0.01], [0.1, -0.5]]), 1e-5, viewpoint=near)
    planar = on_deformation_plane(seen, 0.9)
    assert planar is not None
    assert len(planar.points) == 1
    assert np.isfinite(planar.points).all()


def test_a_known_plane_is_mirrored_with_the_frame() -> None:
    seen = inclined(POINTS, 1e-5, known_psi=0.4)
    mirror = np.diag([1.0, -1.0, 1.0, 1.0])
    other = dataclasses.replace(seen, antenna_from_beam=mirror)
    one, two = known_plane(seen), known_plane(other)
    assert not isinstance(one, Estimate)
    assert not isinstance(two, Estimate)
    assert one[1] == pytest.approx(0.4)
    assert two[1] == pytest.approx(-0.4)
