"""Learn where the clamp is relative to the motor's axis, from pushes against objects at rest.

A camera that turns with the antenna never shows the axis. But an object that does not move touches
the beam at one place of Sigma_o while the motor turns. With the contact p_i from the clamp, in
Sigma_a at the motor angle a_i, the unit normal n_i from the object to the beam there, the radii r
of the beam and R of the object, and the clamp's offset o from the axis,

    R(a_i) (p_i - (r + R) n_i + o) = q

is the same point q, the object's axis relative to the motor's, in all frames of a push. The
equations are linear in o, R and the q of each push. The radius is nearly confounded with the offset
across the object's normal, so that it should be stated: an edge has none. An object that yields
gives way the more the nearer the contact, which the residuals of pushes at several places show; one
that moves with the motor's angle, alike in all pushes, cannot be distinguished from an offset.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np
from scipy.special import chdtri

from solver.core.thresholds import THRESHOLDS
from solver.fitting.push_joint import RADIUS_SIGMA
from solver.instrument.arrays import Floats
from solver.instrument.measurement import Measurement
from solver.instrument.rig import ClampOffset, Rig
from solver.instrument.transforms import turn_about_z
from solver.methods.exact_fit import exact_fit

# Prior sigma of each component where the rig states none, over the beam's length. Chosen: adaptors
# between motor and clamp are a few beam radii to a tenth of the beam in size.
_WIDEST: Final = 0.1
# Derived: in a single push a spring and an offset look alike.
_MIN_PUSHES: Final = 2
# Passes over the equations, whose weights depend weakly on the offset. Chosen: the second moves it
# by far less than its sigma.
_PASSES: Final = 3

# Least sigma [m] of a radius, and of an offset. Chosen: a nanometre.
_CERTAIN: Final = 1e-9


class ObjectRadius(NamedTuple):
    """Radius of the touched objects and its sigma [m], of all of them and of each by itself."""

    radius: float
    sigma: float


@dataclass(frozen=True)
class LearnedOffset:
    """Clamp offset that pushes show, beside that of the rig.

    `offset` is the estimate. `chi2` with `dof` degrees of freedom are the residuals about it, and
    `excess` is the increase of chi2 with the rig's offset. `still` is whether the objects may have
    been at rest, and `needed` whether the rig's offset is contradicted, or uncertain: only an
    offset that is needed, against objects at rest, is used.
    """

    offset: ClampOffset
    chi2: float
    dof: int
    excess: float
    still: bool
    needed: bool

    @property
    def used(self) -> bool:
        """Whether the offset replaces that of the rig."""
        return self.still and self.needed


class _Touch(NamedTuple):
    """Contact (2,) [m] from the clamp and normal (2,), along the axes of Sigma_a.

    `covariance` (3, 3) is that of the contact and of the normal's angle.
    """

    motor_angle: float
    point: Floats
    normal: Floats
    covariance: Floats


def learn_clamp_offset(
    pushes: Sequence[Sequence[Measurement]], rig: Rig, radius: ObjectRadius | None = None
) -> LearnedOffset | None:
    """Learn the offset with the beam of `rig`; None unless two pushes turn a motor that is read.

    Each push is against one object at rest; `radius` is that of all objects, unknown if it is None.
    """
    touches = [_touches(push, rig) for push in pushes]
    least = THRESHOLDS.min_turn_sigmas * max(rig.tolerances.encoder, THRESHOLDS.min_encoder_sigma)
    turned = [push for push in touches if np.ptp([one.motor_angle for one in push] or [0]) > least]
    if len(turned) < _MIN_PUSHES or rig.camera_mount == "world":
        return None
    radius = radius or ObjectRadius(0.0, RADIUS_SIGMA * rig.beam.length)
    stated = rig.clamp_offset
    uncertain = bool(stated.covariance.any())
    # A nanometre keeps the covariance of a certain direction regular.
    sigma = _CERTAIN if uncertain else _WIDEST * rig.beam.length
    prior = stated.covariance + np.eye(2) * sigma**2
    root = np.linalg.inv(np.linalg.cholesky(prior))
    of_prior = np.pad(root, ((0, 0), (0, 1 + 3 * len(turned))))
    position = stated.position
    for _ in range(_PASSES):
        matrix, target = _system(turned, rig, radius, position)
        equations, values = np.vstack([matrix, of_prior]), np.append(target, root @ stated.position)
        fit = _least_squares(equations, values)
        position = fit.unknowns[:2]
    held = _least_squares(matrix[:, 2:], target - matrix[:, :2] @ stated.position)
    excess = held.chi2 - fit.chi2
    # Radii and offset have priors: only the places reduce the degrees of freedom.
    dof = 2 * sum(len(push) - 1 for push in turned)
    limits = chdtri([dof, 2], THRESHOLDS.false_rejection)
    return LearnedOffset(
        offset=ClampOffset(position, fit.covariance[:2, :2]),
        chi2=fit.chi2,
        dof=dof,
        excess=excess,
        still=bool(fit.chi2 < limits[0]),
        needed=bool(uncertain or excess > limits[1]),
    )


def _touches(push: Sequence[Measurement], rig: Rig) -> list[_Touch]:
    """Estimate the contacts of a push's frames, in a Sigma_a without error."""
    exact = replace(rig.tolerances, board_translation=0.0, board_rotation=0.0)
    touches = []
    for measurement in push:
        estimate = exact_fit(replace(measurement, rig=replace(rig, tolerances=exact)))
        if not estimate.values or measurement.motor_angle is None or estimate.covariance is None:
            continue
        names = list(estimate.values)
        chosen = ["contact_antenna_x_m", "contact_antenna_y_m", "theta_c_rad"]
        rows = [names.index(name) for name in chosen]
        x, y, theta = (estimate.values[name] for name in chosen)
        axes, clamp = measurement.antenna_from_beam[:2, :2], measurement.antenna_from_beam[:2, 3]
        touches.append(
            _Touch(
                measurement.motor_angle,
                np.array([x, y]) - clamp,
                axes @ np.array([-math.sin(theta), math.cos(theta)]),
                estimate.covariance[np.ix_(rows, rows)],
            )
        )
    return touches


class _System(NamedTuple):
    """Whitened equations (m, p) of all touches, with the priors of the radii, and targets (m,).

    The unknowns are the offset (2), the radius that all objects share, and the radius and the place
    (2) of the object of each push.
    """

    matrix: Floats
    target: Floats


def _system(
    pushes: Sequence[Sequence[_Touch]], rig: Rig, radius: ObjectRadius, position: Floats
) -> _System:
    """Make the equations, with weights at the offset `position` (2,)."""
    unknowns = 3 + 3 * len(pushes)
    encoder = max(rig.tolerances.encoder, THRESHOLDS.min_encoder_sigma)
    reach = rig.beam.radius + radius.radius
    rows, targets = [], []
    for i, push in enumerate(pushes):
        own = 3 + 3 * i
        for touch in push:
            turn = turn_about_z(touch.motor_angle)[:2, :2]
            side = rig.deflects_towards * np.array([-touch.normal[1], touch.normal[0]])
            by_point = turn @ np.column_stack([np.eye(2), -reach * side])
            x, y = turn @ (touch.point + position - reach * touch.normal)
            by_angle = encoder * np.array([-y, x])
            covariance = by_point @ touch.covariance @ by_point.T + np.outer(by_angle, by_angle)
            row = np.zeros((2, unknowns))
            row[:, :2] = turn
            row[:, 2] = row[:, own] = -turn @ touch.normal
            row[:, own + 1 : own + 3] = -np.eye(2)
            whitener = np.linalg.inv(np.linalg.cholesky(covariance))
            rows.append(whitener @ row)
            targets.append(whitener @ turn @ (reach * touch.normal - touch.point))
    radii = np.eye(unknowns)[[2, *range(3, unknowns, 3)]] / max(radius.sigma, _CERTAIN)
    return _System(np.vstack([*rows, radii]), np.concatenate([*targets, np.zeros(len(radii))]))


class _LinearFit(NamedTuple):
    """Solution (p,) of linear equations, its covariance (p, p), and chi2."""

    unknowns: Floats
    covariance: Floats
    chi2: float


def _least_squares(matrix: Floats, target: Floats) -> _LinearFit:
    """Solve whitened equations (m, p), (m,) by least squares."""
    # In units in which each unknown has the same weight.
    unit = np.linalg.norm(matrix, axis=0)
    scaled = matrix / unit
    unknowns = np.linalg.lstsq(scaled, target)[0] / unit
    residual = target - matrix @ unknowns
    covariance = np.linalg.inv(scaled.T @ scaled) / np.outer(unit, unit)
    return _LinearFit(unknowns, (covariance + covariance.T) / 2, float(residual @ residual))
