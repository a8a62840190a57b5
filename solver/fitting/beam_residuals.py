"""Compute residuals of one frame of any beam, with the exact Jacobian.

All lengths are in units of the beam's length L. The parameters are those of the shape and of the
clamp, as in `beams.beam`. Points, view and the rays through them are those of `residuals`.
"""

import numpy as np

from solver.beams.beam import DX, DY, POSE, PSI, SOFTNESS, TILT, Beam
from solver.beams.curve import Curve, U, interpolated
from solver.core.thresholds import THRESHOLDS
from solver.instrument.arrays import Floats
from solver.instrument.compiled import njit
from solver.uniform.residuals import SIGMA_X, SIGMA_Y, X, Y, weight_of


def beam_residuals(
    beam: Beam, p: Floats, points: Floats, view: Floats, residual: Floats, jacobian: Floats
) -> bool:
    """Write `residual` (n,) and `jacobian` (p, n) in sigmas; return whether the shape exists.

    The Jacobian is evaluated where each point's ray would be without its error, as in `residuals`.
    """
    bent = beam.bent(p[: len(beam.parameters)])
    if bent is None:
        return False
    curve, moment, by_moment = bent.curve, bent.moment, bent.by_moment
    return bool(curve_residuals(p, curve, moment, by_moment, points, view, residual, jacobian))


@njit
def curve_residuals(
    p: Floats,
    curve: Curve,
    moment: float,
    by_moment: Floats,
    points: Floats,
    view: Floats,
    residual: Floats,
    jacobian: Floats,
) -> bool:
    """Write the residuals of a `curve` as `beam_residuals`.

    `moment` [EI / L] is that at the clamp, with its gradient (k,) by the k parameters of the shape.
    """
    k = len(p) - POSE
    if abs(p[k + PSI]) >= np.pi / 2:
        return False
    n = points.shape[1]
    shifted = np.empty((2, n))
    for i in range(n):
        shifted[X, i], shifted[Y, i] = points[X, i], points[Y, i]
    if not _evaluate(p, curve, moment, by_moment, shifted, points, view, residual, jacobian):
        return False
    scratch = np.empty(n)
    for i in range(n):
        shifted[X, i] -= residual[i] * points[SIGMA_X, i]
        shifted[Y, i] -= residual[i] * points[SIGMA_Y, i]
    if not _evaluate(p, curve, moment, by_moment, shifted, points, view, scratch, jacobian):
        return False
    # Newton's second step towards the curve: the sum's Jacobian is that of this step.
    for i in range(n):
        residual[i] += scratch[i]
    return True


@njit
def _evaluate(
    p: Floats,
    curve: Curve,
    moment: float,
    by_moment: Floats,
    positions: Floats,
    points: Floats,
    view: Floats,
    residual: Floats,
    jacobian: Floats,
) -> bool:
    k = len(p) - POSE
    nodes, gradients = curve.nodes, curve.gradients
    last = nodes.shape[1] - 2
    lever, height, angle = curve.base
    turn = p[k + TILT] + p[k + SOFTNESS] * moment
    cos_tilt, sin_tilt = np.cos(turn), np.sin(turn)
    cos_psi, sin_psi = np.cos(p[k + PSI]), np.sin(p[k + PSI])
    cosine, sine = np.cos(angle), np.sin(angle)
    dx, dy = p[k + DX], p[k + DY]
    node = last
    vx, vy, vw = view
    for i in range(points.shape[1]):
        mx, my = positions[X, i], positions[Y, i]
        rotated_x = cos_tilt * (mx - dx) + sin_tilt * (my - dy)
        rotated_y = cos_tilt * (my - dy) - sin_tilt * (mx - dx)
        ray_x = cos_tilt * (vx - vw * mx) + sin_tilt * (vy - vw * my)
        ray_y = cos_tilt * (vy - vw * my) - sin_tilt * (vx - vw * mx)
        grazing = cos_psi - sin_psi * ray_y
        if grazing < THRESHOLDS.min_grazing:
            return False
        y = rotated_y / grazing
        x = rotated_x + sin_psi * ray_x * y
        along, across = x * cosine + y * sine, y * cosine - x * sine
        u = lever - along
        while node > 0 and u < nodes[U, node]:
            node -= 1
        while node < last and u > nodes[U, node + 1]:
            node += 1
        value, tangent, weights = interpolated(nodes, node, u)
        by_x, by_y = tangent * cosine - sine, cosine + tangent * sine
        by_turn = tangent * across - along
        # As in `residuals`: by y, x following along the ray, and by the ray's direction.
        by_y += by_x * sin_psi * ray_x
        by_k = by_y / grazing
        by_ray_x, by_ray_y = by_x * sin_psi * y, by_k * y * sin_psi
        sigma_x = cos_tilt * points[SIGMA_X, i] + sin_tilt * points[SIGMA_Y, i]
        sigma_y = cos_tilt * points[SIGMA_Y, i] - sin_tilt * points[SIGMA_X, i]
        weight = weight_of((by_x - vw * by_ray_x) * sigma_x + (by_k - vw * by_ray_y) * sigma_y)
        residual[i] = (height + across - value) * weight
        by_tilt = by_x * rotated_y - by_k * rotated_x + by_ray_x * ray_y - by_ray_y * ray_x
        for j in range(k):
            moved = (
                weights[0] * gradients[j, 0, node]
                + weights[1] * gradients[j, 1, node]
                + weights[2] * gradients[j, 0, node + 1]
                + weights[3] * gradients[j, 1, node + 1]
            )
            jacobian[j, i] = weight * (
                curve.by_base[j, 1]
                - tangent * curve.by_base[j, 0]
                + by_turn * curve.by_base[j, 2]
                - moved
                + by_tilt * p[k + SOFTNESS] * by_moment[j]
            )
        by_psi = by_k * y * (sin_psi + cos_psi * ray_y) + by_x * cos_psi * ray_x * y
        jacobian[k + PSI, i] = by_psi * weight
        jacobian[k + DX, i] = (sin_tilt * by_k - cos_tilt * by_x) * weight
        jacobian[k + DY, i] = -(sin_tilt * by_x + cos_tilt * by_k) * weight
        jacobian[k + TILT, i] = by_tilt * weight
        jacobian[k + SOFTNESS, i] = by_tilt * moment * weight
    return True
