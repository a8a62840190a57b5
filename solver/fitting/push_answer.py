"""What a contact is in all frames of reference: the words of an estimate, with their covariance."""

import math
from typing import Final

import numpy as np

from solver.beam_models import exact
from solver.instrument.arrays import Floats
from solver.instrument.estimate import Estimate, Outcome
from solver.instrument.measurement import Measurement
from solver.instrument.rig import Rig
from solver.instrument.transforms import turn_about_z

# A place known worse than this share of the beam's length is only an interval.
WEAK_SIGMA: Final = 1 / 7
# By what the quantities below have gradients; `scale` is the relative error of all lengths,
# `height` the clamp's over plane C.
SHAPE: Final = (
    *("q", "lever", "psi", "dx", "dy", "tilt", "motor_angle", "rigidity", "scale", "height"),
)


def contact_quantities(
    measurement: Measurement, shape: Floats, motor_angle: float | None
) -> tuple[dict[str, float], Floats]:
    """Values of the contact's quantities (m,), and their Jacobian (m, 10) by `SHAPE`.

    `shape` is (q, lever, psi, dx, dy, tilt): the exact beam's, the deformation plane's inclination
    against plane C, seen along the beam at rest, and the clamp's pose. `motor_angle` [rad] carries
    Sigma_a into Sigma_o by (1), turning about the clamp; without it what is of Sigma_o is absent.
    """
    q, lever, psi, dx, dy, tilt = (float(v) for v in shape)
    rigidity = measurement.rig.beam.flexural_rigidity
    at, force = exact.contact(q, lever), q * rigidity
    # Similarity: lengths grow with the scale, the force at a given shape falls with its square.

    def by(**gradients: float) -> Floats:
        return np.array([gradients.get(name, 0.0) for name in SHAPE])

    def of_shape(gradient: Floats, scale: float = 0.0) -> Floats:
        return by(q=gradient[0], lever=gradient[1], scale=scale)

    d_x, d_y = of_shape(at.d_x_c, at.x_c), of_shape(at.d_y_c, at.y_c)
    d_theta = of_shape(at.d_theta_c)
    d_force = by(q=rigidity, rigidity=q, scale=-2 * force)
    sine, cosine = np.sin(at.theta_c), np.cos(at.theta_c)
    # Along the deformation plane's axis across the beam, and how psi turns it.
    across, turned = (
        np.array([0, np.cos(psi), np.sin(psi)]),
        np.array([0, -np.sin(psi), np.cos(psi)]),
    )
    along, d_psi = np.array([1.0, 0.0, 0.0]), by(psi=1.0)
    point = at.x_c * along + at.y_c * across
    d_point = np.outer(along, d_x) + np.outer(across, d_y) + at.y_c * np.outer(turned, d_psi)
    direction = -sine * along + cosine * across
    d_direction = np.outer(-cosine * along - sine * across, d_theta) + cosine * np.outer(
        turned, d_psi
    )
    push, d_push = force * direction, np.outer(direction, d_force) + force * d_direction
    moved = at.y_c * across
    d_moved = np.outer(across, d_y) + at.y_c * np.outer(turned, d_psi)

    # Out of the clamp's frame into the beam's at rest, and from there into Sigma_a.
    clamp = turn_about_z(tilt)[:3, :3]
    d_clamp = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]]) @ clamp
    axes, origin = measurement.antenna_from_beam[:3, :3], measurement.antenna_from_beam[:3, 3]

    def in_antenna(vector: Floats, gradient: Floats) -> tuple[Floats, Floats]:
        d_tilt = np.outer(d_clamp @ vector, by(tilt=1.0))
        return axes @ clamp @ vector, axes @ (clamp @ gradient + d_tilt)

    side = float(np.sign(np.linalg.det(axes)))
    from_clamp, d_from_clamp = in_antenna(point, d_point)
    stands = origin + axes @ np.array([dx, dy, 0.0])
    d_stands = axes @ np.vstack([by(dx=1.0), by(dy=1.0), by(height=1.0)])
    values: dict[str, float] = {
        "x_c_m": at.x_c,
        "y_c_m": at.y_c,
        "s_c_m": at.s_c,
        "force_n": force,
        "f_n": force * cosine,
        "theta_c_rad": at.theta_c,
        # A rig that deflects towards -y has its measurements mirrored.
        "psi_rad": side * psi,
    }
    rows = [
        d_x,
        d_y,
        of_shape(at.d_s_c, at.s_c),
        d_force,
        cosine * d_force - force * sine * d_theta,
        d_theta,
        side * d_psi,
    ]

    def add(pattern: str, vector: Floats, gradient: Floats, axes: str = "xyz") -> None:
        for axis in axes:
            i = "xyz".index(axis)
            values[pattern.format(axis)] = float(vector[i])
            rows.append(gradient[i])

    add("contact_antenna_{}_m", stands + from_clamp, d_stands + d_from_clamp)
    if motor_angle is not None:
        turn = turn_about_z(motor_angle)[:3, :3]
        in_world = turn @ from_clamp
        by_angle = np.array([-in_world[1], in_world[0], 0.0])
        d_world = turn @ d_from_clamp + np.outer(by_angle, by(motor_angle=1.0))
        add("contact_world_{}_m", stands + in_world, d_stands + d_world)
    add("force_{}_n", *in_antenna(push, d_push))
    add("displacement_{}_m", *in_antenna(moved, d_moved), axes="yz")
    return values, np.array(rows)


def judged(
    rig: Rig,
    values: dict[str, float],
    covariance: Floats,
    message: str,
    *,
    chi2: float,
    dof: int,
    iterations: int,
) -> Estimate:
    """The estimate of a contact that the beam can have; else an outcome that says why not."""
    length, names = rig.beam.length, list(values)
    x_sigma, s_sigma = (
        math.sqrt(float(covariance[names.index(name), names.index(name)]))
        for name in ("x_c_m", "s_c_m")
    )
    s_c, s_sigma = values["s_c_m"], math.hypot(s_sigma, rig.tolerances.beam_length)
    outcome = Outcome.CONTACT
    if s_c > length + 3 * s_sigma:
        outcome = Outcome.INVALID
        message = f"the beam would be touched at {s_c:.4g} m, beyond its tip at {length:.4g} m"
    elif x_sigma > length:
        outcome = Outcome.NOT_IDENTIFIABLE
    elif x_sigma > WEAK_SIGMA * length:
        outcome = Outcome.WEAK_CONTACT
    elif s_c > length - 2 * s_sigma:
        outcome = Outcome.TIP_CONTACT
    shown = outcome.has_values
    return Estimate(
        outcome,
        message,
        values=values if shown else {},
        covariance=covariance if shown else None,
        chi2=chi2,
        dof=dof,
        iterations=iterations,
    )
