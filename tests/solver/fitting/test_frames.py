"""A contact in all frames of reference, by one road for all methods."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from solver.baselines.force_sensor import force_sensor
from solver.baselines.linear_fit import linear_fit
from solver.baselines.moment_sensor import moment_sensor
from solver.baselines.three_point import three_point
from solver.baselines.two_point import two_point
from solver.fitting.frames import CONTACT, DY, in_all_frames
from solver.instrument.arrays import Floats
from solver.instrument.estimate import Estimate
from solver.instrument.measurement import Measurement, View
from solver.instrument.rig import Rig, Sensors
from solver.instrument.transforms import rigid, turn_about_z
from solver.methods.exact_fit import exact_fit
from solver.methods.exact_fit_3d import exact_fit_3d
from solver.methods.push_fit import push_fit
from tests.inclined import inclined, pushed
from tests.simulated import BEAM, measurement, pushed_points, rig
from tests.solver.methods.pushes import measured_push, sensing_rig, still
from vbaa_bench.mechanics.planar import push

BASE = np.array([0.03, -0.07, 0.0])
ANGLE = -0.4
Method = Callable[[Measurement], Estimate]


def moved(seen: Measurement, base: Floats = BASE) -> Measurement:
    """The same beam by a rig whose clamp stands at `base` of Sigma_a, its motor turned."""
    placed = seen.antenna_from_beam.copy()
    placed[:3, 3] = base
    angle = None if seen.rig.camera_mount == "world" else ANGLE
    return replace(
        seen,
        rig=replace(seen.rig, base_position=base),
        antenna_from_beam=placed,
        motor_angle=angle,
    )


def assert_turned_about_the_clamp(answer: Estimate) -> None:
    assert answer.values, answer
    antenna, world = (
        np.array([answer.values[f"contact_{frame}_{axis}_m"] for axis in "xyz"])
        for frame in ("antenna", "world")
    )
    angle = answer.values.get("motor_angle_rad", ANGLE)
    assert world - BASE == pytest.approx(turn_about_z(angle)[:3, :3] @ (antenna - BASE), abs=1e-9)
    # Far from a turn about the origin of Sigma_a.
    assert np.linalg.norm(world - turn_about_z(angle)[:3, :3] @ antenna) > 0.01


@pytest.mark.parametrize("method", [two_point, linear_fit, exact_fit])
def test_a_planar_contact_turns_about_the_clamp(method: Method) -> None:
    points, _, _ = pushed_points(0.12, 0.1)
    assert_turned_about_the_clamp(method(moved(measurement(points, 1e-5))))


@pytest.mark.parametrize("method", [three_point, moment_sensor, exact_fit_3d])
def test_a_contact_out_of_plane_turns_about_the_clamp(method: Method) -> None:
    points, truth = pushed(0.12, 0.1, 0.3)
    seen = inclined(points, 1e-7, moment_y=truth["moment_y"], moment_sigma=1e-5)
    assert_turned_about_the_clamp(method(moved(seen)))


def test_a_contact_that_is_felt_turns_about_the_clamp() -> None:
    state = push(BEAM, 0.12, pushing_angle=0.15)
    seen = replace(
        measurement(np.zeros((0, 2)), 1e-5),
        rig=sensing_rig(1e-3, 1e-4),
        base_force=tuple(state.base_force),
        base_moment=tuple(state.base_moment),
    )
    assert_turned_about_the_clamp(force_sensor(moved(seen)))


def test_a_push_turns_about_the_clamp() -> None:
    seen, _ = measured_push(still(0.12, 0.0), onset=ANGLE + math.radians(15), radius=0.0)

    def there(frame: Measurement) -> Measurement:
        return replace(moved(frame), motor_angle=frame.motor_angle)

    earlier = tuple(there(frame) for frame in seen.earlier)
    answer = push_fit(replace(there(seen), earlier=earlier))
    assert "compliance_m_per_n" in answer.values
    antenna, world = (
        np.array([answer.values[f"contact_{frame}_{axis}_m"] for axis in "xyz"]) - BASE
        for frame in ("antenna", "world")
    )
    # The angle is the encoder's reading as the shapes correct it.
    assert world == pytest.approx(turn_about_z(ANGLE)[:3, :3] @ antenna, abs=2e-6)


@pytest.mark.parametrize("base", [np.zeros(3), BASE])
def test_a_camera_in_the_world_sees_the_beam_turn_about_the_clamp(base: Floats) -> None:
    points, x_c, _ = pushed_points(0.15, 0.1)
    turn = turn_about_z(ANGLE)[:2, :2]
    plain = measurement(points @ turn.T, 1e-5)
    seen = replace(
        plain,
        view=View(points @ turn.T, plain.sigma_vectors, plain.view.viewpoint),
        rig=replace(plain.rig, camera_mount="world"),
        motor_angle=None,
        base_covariance=np.diag([1e-6, 1e-6, 0.5]) ** 2,
    )
    answer = exact_fit(moved(seen, base))
    assert answer.values["x_c_m"] == pytest.approx(x_c, abs=2e-6)
    assert answer.values["motor_angle_rad"] == pytest.approx(ANGLE, abs=2e-5)
    if base.any():
        assert_turned_about_the_clamp(answer)


def contact(psi: float = 0.0) -> Floats:
    at = np.zeros(CONTACT)
    at[:6] = 0.12, 0.02, 0.122, 0.5, 0.2, psi
    at[9] = ANGLE
    return at


def known_to(**tolerances: float) -> Rig:
    board = rigid(np.zeros(3), [0.1, -0.02, 0.0])
    return replace(rig(**tolerances), antenna_from_board=board)


@pytest.mark.parametrize("linear", [True, False])
def test_the_place_is_known_no_better_than_that_of_the_board(linear: bool) -> None:
    nothing = measurement(np.zeros((0, 2)), 1e-5)

    def sigma(**tolerances: float) -> dict[str, float]:
        seen = moved(replace(nothing, rig=known_to(**tolerances)))
        values, _, placed = in_all_frames(seen, contact(), linear=linear)
        return dict(zip(values, np.sqrt(np.diag(placed)), strict=True))

    shifted = sigma(board_translation=1e-3)
    for frame in ("antenna", "world"):
        for axis in "xyz":
            assert shifted[f"contact_{frame}_{axis}_m"] == pytest.approx(1e-3)
    assert shifted["x_c_m"] == shifted["force_n"] == 0
    raised = sigma(base_position=1e-3)
    assert raised["contact_antenna_z_m"] == pytest.approx(1e-3)
    assert raised["contact_antenna_y_m"] == 0
    # About the board's middle, by the lever arm.
    arm = BASE + np.array([0.02, 0.04, 0.0])
    turned = sigma(board_rotation=1e-3)
    assert turned["contact_antenna_x_m"] == pytest.approx(1e-3 * abs(arm[1]))
    assert turned["contact_antenna_y_m"] == pytest.approx(1e-3 * abs(arm[0]))
    assert turned["contact_antenna_z_m"] == pytest.approx(1e-3 * math.hypot(arm[0], arm[1]))
    assert turned["x_c_m"] == 0


def test_what_is_not_estimated_is_absent() -> None:
    nothing = measurement(np.zeros((0, 2)), 1e-5)
    third = {"psi_rad", "force_z_n", "displacement_z_m"}
    planar, _, _ = in_all_frames(nothing, contact())
    assert not third & set(planar)
    strip = replace(nothing, rig=replace(nothing.rig, known_psi=0.3))
    for values, _, _ in (
        in_all_frames(nothing, contact(0.3), psi_fitted=True),
        in_all_frames(strip, contact(0.3)),
    ):
        assert third <= set(values)
    unread, _, _ = in_all_frames(replace(nothing, motor_angle=None), contact())
    assert not any("world" in name or "motor" in name for name in unread)
    small, _, _ = in_all_frames(nothing, contact(), linear=True)
    assert not {"s_c_m", "theta_c_rad", "force_x_n"} & set(small)


@pytest.mark.parametrize("method", [two_point, linear_fit, exact_fit])
def test_all_methods_tell_the_same_of_a_plane(method: Method) -> None:
    points, _, _ = pushed_points(0.12, 0.05)
    names = set(method(measurement(points, 1e-5)).values) | {"s_c_m", "theta_c_rad", "force_x_n"}
    assert names == set(exact_fit(measurement(points, 1e-5)).values)


def test_a_moment_without_a_sigma_is_left_out_in_words() -> None:
    points, truth = pushed(0.15, 0.1, 0.5)
    seen = inclined(points, 1e-7, moment_y=truth["moment_y"])
    answer = exact_fit_3d(seen)
    assert "no sigma for its moment sensor" in answer.message
    weighed = replace(seen, rig=replace(seen.rig, sensors=Sensors(1e-4)))
    assert exact_fit_3d(weighed).message == ""


def test_a_shifted_image_does_not_move_the_contact() -> None:
    """Of the clamp's displacement in the image, each cause has the share of its variance."""
    nothing = measurement(np.zeros((0, 2)), 1e-5)
    shifted = contact()
    shifted[DY] = 1e-4
    y = "contact_antenna_y_m"

    def placed(clamp: float, image: float) -> tuple[float, float]:
        """Return the contact's y for standard deviations [m], and the sigma of the shift."""
        seen = replace(
            nothing,
            base_covariance=np.diag([1e-12, clamp**2 + image**2, 1e-12]),
            image_shift=np.diag([0.0, image**2]),
        )
        values, by_contact, poses = in_all_frames(seen, shifted)
        row = list(values).index(y)
        total = by_contact[row, DY] ** 2 * (clamp**2 + image**2) + poses[row, row]
        # Whether or not the displacement is fitted, the clamp's own variance remains in all.
        assert total == pytest.approx(clamp**2, rel=1e-6)
        return values[y], float(np.sqrt(poses[row, row]))

    still, moved_clamp = placed(1e-9, 1e-4), placed(1e-4, 1e-9)
    assert moved_clamp[0] - still[0] == pytest.approx(1e-4, rel=1e-6)
    assert still[1] < 2e-9
    half, sigma = placed(1e-4, 1e-4)
    assert half - still[0] == pytest.approx(0.5e-4, rel=1e-6)
    assert sigma == pytest.approx(1e-4 / np.sqrt(2), rel=1e-6)
