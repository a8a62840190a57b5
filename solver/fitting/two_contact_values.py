"""Convert the shape of a beam with two contacts to values of both, with their joint covariance."""

import math
from typing import Final

import numpy as np

from solver.beams.beam import FRICTION_RATIO
from solver.fitting import frames
from solver.fitting.frame_problem import FrameProblem
from solver.fitting.frame_values import (
    force_variance_second_order,
    input_variances,
    mounted_contact,
)
from solver.instrument.arrays import Floats
from solver.instrument.measurement import Measurement
from solver.uniform.fit import FrameFit

# Names of the outer contact's values, by those of a single contact.
_SECOND: Final = {
    name: f"second_{name}"
    for name in (
        "s_c_m",
        "force_n",
        *(f"contact_antenna_{axis}_m" for axis in "xyz"),
        *(f"force_{axis}_n" for axis in "xyz"),
    )
}


def two_contact_values(
    measurement: Measurement, problem: FrameProblem, fit: FrameFit
) -> tuple[dict[str, float], Floats]:
    """Compute the values of a fit by name, and their joint covariance.

    The inner contact has the names of a single one, the outer one those of `second_...`.
    """
    count, at, bent = len(fit.p), problem.parameters, problem.bent(fit.p)
    assert bent is not None, "the fit has a shape"
    values: dict[str, float] = {}
    by_variables, by_poses, curved = [], [], []
    for i, (names, friction_ratio) in enumerate(
        (
            ({name: name for name in frames.NAMES}, at["friction_ratio_inner"]),
            (_SECOND, FRICTION_RATIO),
        )
    ):
        contact, by_variable = mounted_contact(
            measurement.rig, at, fit.p, measurement.motor_angle or 0.0, bent, i
        )
        estimated, by_contact, by_pose = frames.with_jacobians(
            measurement, contact, clamp_fitted=True
        )
        # A force has a magnitude; its sign is that of the components.
        sign = math.copysign(1.0, estimated["force_n"])
        estimated["force_n"] *= sign
        labels = list(estimated)
        by_contact[labels.index("force_n")] *= sign
        kept = [k for k, label in enumerate(labels) if label in names]
        values |= {names[labels[k]]: estimated[labels[k]] for k in kept}
        by_variables.append((by_contact @ by_variable)[kept])
        by_poses.append(by_pose[kept])
        friction_ratio_sigma = math.sqrt(fit.covariance[friction_ratio, friction_ratio])
        curved.append(
            force_variance_second_order(
                estimated["force_n"], float(fit.p[friction_ratio]), friction_ratio_sigma
            )
        )
    covariance = np.zeros((count + 3, count + 3))
    covariance[:count, :count] = fit.covariance
    covariance[range(count, count + 3), range(count, count + 3)] = input_variances(measurement)
    total = np.concatenate(by_variables)
    result = total @ covariance @ total.T
    result += frames.pose_covariance(measurement, np.concatenate(by_poses))
    for name, variance in zip(("force_n", "second_force_n"), curved, strict=True):
        row = list(values).index(name)
        result[row, row] += variance
    return values, np.asarray(result)
