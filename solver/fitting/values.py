"""From the fitted beam to what is asked of it: contact, force and displacement, with covariance."""

from typing import Any, Final

import numpy as np
from numba import njit

from solver.beam_models.exact import contact_at
from solver.fitting.problem import FrameFit, Problem
from solver.fitting.residuals import DX, DY, LEVER, PIVOT_X, PIVOT_Y, PSI, RIGIDITY, TILT, Q
from solver.instrument.arrays import Floats
from solver.instrument.measurement import Measurement

NAMES: Final = (
    "x_c_m", "y_c_m", "s_c_m", "force_n", "f_n", "theta_c_rad", "psi_rad",
    "contact_antenna_x_m", "contact_antenna_y_m", "contact_antenna_z_m",
    "contact_world_x_m", "contact_world_y_m", "contact_world_z_m",
    "force_x_n", "force_y_n", "force_z_n", "displacement_y_m", "displacement_z_m",
    "motor_angle_rad",
)  # fmt: skip
# What is said of the third dimension; of an assumed psi nothing is known of it.
_SPATIAL: Final = frozenset({"psi_rad", "force_z_n", "displacement_z_m"})
_WORLD: Final = frozenset({"contact_world_x_m", "contact_world_y_m", "contact_world_z_m"})
# What the values depend on: q, lever, psi, dx, dy, tilt, relative errors of EI and of all lengths,
# the motor's angle, and the clamp's height over plane C.
_INPUTS: Final = 10
_EI, _SCALE, _ANGLE, _HEIGHT = 6, 7, 8, 9


def values_of(
    measurement: Measurement, problem: Problem, fit: FrameFit, psi_known: bool
) -> tuple[dict[str, float], Floats]:
    """The values that `fit` tells, by name, and their joint covariance.

    It holds the fit's own covariance, the rig's tolerances of EI and of the clamp's height, the
    error of all lengths and the encoder's. `psi_known`: psi was fitted, or the rig states it.
    """
    rig, length = measurement.rig, measurement.rig.beam.length
    unit = np.array([length**-2, length, 1.0, length, length, 1.0, 1.0])
    chosen = [Q, LEVER, PSI, DX, DY, TILT, RIGIDITY]
    inputs, covariance = np.zeros(_INPUTS), np.zeros((_INPUTS, _INPUTS))
    inputs[:7] = fit.p[chosen] * unit
    covariance[:7, :7] = fit.covariance[np.ix_(chosen, chosen)] * np.outer(unit, unit)
    if covariance[_EI, _EI] == 0:  # where the fit had no need of EI
        tolerance = rig.tolerances.flexural_rigidity / rig.beam.flexural_rigidity
        covariance[_EI, _EI] = tolerance**2
    covariance[_SCALE, _SCALE] = measurement.scale_sigma**2
    if measurement.motor_angle is not None:
        inputs[_ANGLE] = measurement.motor_angle
        covariance[_ANGLE, _ANGLE] = rig.tolerances.encoder**2
    covariance[_HEIGHT, _HEIGHT] = rig.tolerances.base_position**2
    known = problem.arrays[4]
    pivot = known[[PIVOT_X, PIVOT_Y]] * length
    rest = (
        np.ascontiguousarray(measurement.antenna_from_beam),
        pivot,
        problem.in_world,
        rig.beam.flexural_rigidity,
    )
    values, jacobian = _with_jacobian(inputs, _steps(inputs, length), *rest)
    told = [i for i, name in enumerate(NAMES) if _is_told(name, measurement, problem, psi_known)]
    jacobian = jacobian[told]
    return (
        {NAMES[i]: float(values[i]) for i in told},
        np.asarray(jacobian @ covariance @ jacobian.T),
    )


def _is_told(name: str, measurement: Measurement, problem: Problem, psi_known: bool) -> bool:
    if name in _SPATIAL:
        return psi_known
    if name in _WORLD:
        return problem.in_world or measurement.motor_angle is not None
    return name != "motor_angle_rad" or problem.in_world


def _steps(inputs: Floats, length: float) -> Floats:
    """Steps of a central difference: what is lost to curvature and to rounding is 1e-10."""
    scale = np.array([0, 0, 1, length, length, 1, 1, 1, 1, length])
    scale[:2] = inputs[:2]
    return np.asarray(1e-5 * scale)


@njit(cache=True, error_model="numpy")
def _values(
    v: Floats, antenna_from_beam: Floats, pivot: Floats, in_world: bool, rigidity: float
) -> Floats:
    """The values of NAMES."""
    theta, x_c, y_c, s_c = contact_at(v[0], v[1])
    # By similarity: lengths by 1 + e, the force by its inverse square.
    scale = 1 + v[_SCALE]
    force = v[0] * rigidity * (1 + v[_EI]) / (scale * scale)
    sine, cosine = np.sin(theta[0]), np.cos(theta[0])
    cos_psi, sin_psi = np.cos(v[2]), np.sin(v[2])
    c, s = np.cos(v[5]), np.sin(v[5])
    x, side, up = x_c[0] * scale, y_c[0] * cos_psi * scale, y_c[0] * sin_psi * scale
    across, along = force * cosine, -force * sine
    rotation = np.ascontiguousarray(antenna_from_beam[:3, :3])
    handed = np.sign(np.linalg.det(rotation))
    # In plane C's axes; the clamp's turn about the motor's axis carries the clamp along.
    from_x, from_y = x - pivot[0], side - pivot[1]
    seen = np.array(
        [
            pivot[0] + v[3] + c * from_x - s * from_y,
            pivot[1] + v[4] + s * from_x + c * from_y,
            up + v[_HEIGHT],
        ]
    )
    turned_force = np.array(
        [c * along - s * across * cos_psi, s * along + c * across * cos_psi, across * sin_psi]
    )
    moved = np.array([-s * side, c * side, up])
    angle = v[_ANGLE]
    if in_world:
        # Plane C stands still: what is seen is the world's, and Sigma_a has turned by the tilt.
        angle = handed * v[5]
    else:
        placed = rotation @ seen + antenna_from_beam[:3, 3]
    ca, sa = np.cos(angle), np.sin(angle)
    if in_world:
        world = rotation @ seen + antenna_from_beam[:3, 3]
        placed = np.array([ca * world[0] + sa * world[1], ca * world[1] - sa * world[0], world[2]])
        turned_force = np.array([along, across * cos_psi, across * sin_psi])
        moved = np.array([0.0, side, up])
    else:
        world = np.array(
            [ca * placed[0] - sa * placed[1], sa * placed[0] + ca * placed[1], placed[2]]
        )
    turned_force, moved = rotation @ turned_force, rotation @ moved
    return np.array(
        [
            x, y_c[0] * scale, s_c[0] * scale, force, across, theta[0], handed * v[2],
            placed[0], placed[1], placed[2], world[0], world[1], world[2],
            turned_force[0], turned_force[1], turned_force[2], moved[1], moved[2], angle,
        ]
    )  # fmt: skip


@njit(cache=True, error_model="numpy")
def _with_jacobian(
    inputs: Floats,
    steps: Floats,
    antenna_from_beam: Floats,
    pivot: Floats,
    in_world: bool,
    rigidity: float,
) -> Any:
    """Values (n,) and their Jacobian (n, 10) by central differences of one formula."""
    values = _values(inputs, antenna_from_beam, pivot, in_world, rigidity)
    jacobian = np.empty((len(values), len(inputs)))
    for j in range(len(inputs)):
        ahead, behind = inputs.copy(), inputs.copy()
        ahead[j] += steps[j]
        behind[j] -= steps[j]
        there = _values(ahead, antenna_from_beam, pivot, in_world, rigidity)
        back = _values(behind, antenna_from_beam, pivot, in_world, rigidity)
        for i in range(len(values)):
            jacobian[i, j] = (there[i] - back[i]) / (2 * steps[j])
    return values, jacobian
