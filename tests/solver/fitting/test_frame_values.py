"""Values of a beam of changing section on a clamp that gives, against rough objects."""

from dataclasses import replace

import numpy as np
import pytest

from solver.fitting import frames
from solver.fitting.frame_problem import frame_problem_of
from solver.fitting.frame_values import fitted_contact
from solver.instrument.arrays import Floats
from solver.instrument.beam_shape import BeamShape
from solver.uniform.problem import problem_of
from tests.solver.methods.pushes import measured_push, mirrored, still

CONE = BeamShape(
    widths=np.array([-0.1, 0.05]), softness=0.03, covariance=np.zeros((5, 5)), friction_sigma=0.2
)


@pytest.mark.parametrize("mount", ["antenna", "world"])
def test_the_gradients_of_values_are_their_derivatives(mount: str) -> None:
    measurement, _ = measured_push(still(0.12, 0.0), angles_deg=(5.0,))
    seen = mirrored(measurement)
    if mount == "world":
        seen = replace(seen, motor_angle=None)
    seen = replace(seen, rig=replace(seen.rig, camera_mount=mount, shape=CONE))
    problem = frame_problem_of(seen, problem_of(seen, with_tip=False))
    p = problem.mean.copy()
    names = problem.parameters
    for name, value in (
        ("q", 0.8), ("s_c", 0.5), ("friction_ratio", 0.3), ("psi", 0.4), ("dx", 1e-3),
        ("dy", -2e-3), ("tilt", 0.01),
    ):  # fmt: skip
        p[names[name]] = value

    def values(p: Floats, motor_angle: float) -> tuple[Floats, Floats]:
        contact, by_p = fitted_contact(seen.rig, problem, p, motor_angle)
        named, by_contact, _ = frames.in_all_frames(
            seen, contact, psi_fitted=True, clamp_fitted=True
        )
        return np.array(list(named.values())), by_contact @ by_p

    _, jacobian = values(p, 0.3)
    assert jacobian.shape == (19 if mount == "world" else 18, len(p) + 3)
    for i in range(len(p) + 1):
        step = np.zeros(len(p) + 1)
        step[i] = 1e-6
        ahead, _ = values(p + step[:-1], 0.3 + step[-1])
        behind, _ = values(p - step[:-1], 0.3 - step[-1])
        slope = (ahead - behind) / 2e-6
        assert jacobian[:, i] == pytest.approx(slope, rel=1e-5, abs=1e-7), i


def test_the_gradients_by_ei_and_by_all_lengths_are_derivatives() -> None:
    measurement, _ = measured_push(still(0.12, 0.0), angles_deg=(5.0,))
    rig = replace(measurement.rig, shape=CONE)
    seen = replace(measurement, rig=rig)
    problem = frame_problem_of(seen, problem_of(seen, with_tip=False))
    p = problem.mean.copy()
    for name, value in (("q", 0.8), ("s_c", 0.5), ("friction_ratio", 0.3), ("tilt", 0.01)):
        p[problem.parameters[name]] = value  # the clamp is at the origin
    _, jacobian = fitted_contact(rig, problem, p, 0.3)
    step = 1e-6
    for column, name in ((len(p) + 1, "flexural_rigidity"), (len(p) + 2, "length")):
        ahead, behind = (
            fitted_contact(
                replace(rig, beam=replace(rig.beam, **{name: getattr(rig.beam, name) * factor})),
                problem, p, 0.3,
            )[0]
            for factor in (1 + step, 1 - step)
        )  # fmt: skip
        slope = (ahead - behind) / (2 * step)
        assert jacobian[:, column] == pytest.approx(slope, rel=1e-6, abs=1e-10)
