"""Relate beam shapes to the push that makes them, by the object's position in the world.

The object touches the beam at rest at the distance x0 from the clamp, when the motor is at the
onset angle. From there the motor turns the clamp by the pushing angle delta, about an axis through
the clamp (the paper's Assumption 4). The world frame is given by the beam at first contact: x is
along it, y is the direction in which the object pushes the beam. The object is round, with `reach`
[m] from its axis to the beam's centreline: the beam's radius plus its own, which is zero for a
sharp edge. Its axis is at (x0, -reach), and yields along -y, the normal of the beam at first
contact, by its compliance [m/N] times the force's component along y.

Relative to the clamp the axis is at (x_c, y_c) - reach n, n = (-sin theta_c, cos theta_c), and the
force has the direction m = (-sin beta, cos beta), which is n if there is no friction. Rotating both
by -delta into the world gives two equations for a shape:

    y:  -along sin delta + across cos delta = -reach, solved for delta in closed form,
        with (along, across) = (x_c, y_c) - reach n + compliance F m
    x:  x_c cos delta + y_c sin delta + reach sin(theta_c - delta) = x0

With a sharp rigid edge and a thin beam these are y_c = x_c tan(delta) and x_c = x0 cos(delta).
"""

from dataclasses import dataclass

import numpy as np

from solver.beam_models import frictional
from solver.instrument.arrays import Floats
from solver.instrument.beam import Beam


@dataclass(frozen=True)
class Touch:
    """Pushes that make shapes (n,), each quantity with its gradient (5, n).

    `pushing_angle` [rad] is the clamp's rotation since first contact, `distance` [m] the object's
    position along the beam at first contact. Gradients are by (q, lever, grip, compliance, reach).
    """

    pushing_angle: Floats
    distance: Floats
    d_pushing_angle: Floats
    d_distance: Floats


def touch(
    q: Floats, lever: Floats, grip: Floats, compliance: float, reach: float, beam: Beam
) -> Touch | None:
    """Compute the pushes that make the exact beam's shapes (q, lever, grip), each (n,).

    Returns None if a shape does not exist, or no pushing angle below a right angle makes it.
    """
    if not frictional.exists(q, lever, grip):
        return None
    contact = frictional.contact(q, lever, grip, beam.radius)
    rigidity = beam.flexural_rigidity
    sine, cosine = np.sin(contact.theta_c), np.cos(contact.theta_c)
    force_sine, force_cosine = (
        np.sin(contact.theta_c + contact.lean),
        np.cos(contact.theta_c + contact.lean),
    )
    deflection = compliance * rigidity * contact.load
    along = contact.x_c + reach * sine - deflection * force_sine
    across = contact.y_c - reach * cosine + deflection * force_cosine
    radius = np.hypot(along, across)
    if np.any(abs(reach) >= radius):
        return None
    delta = np.arctan2(across, along) + np.arcsin(reach / radius)
    delta_sine, delta_cosine = np.sin(delta), np.cos(delta)
    slope = along * delta_cosine + across * delta_sine
    if np.any((slope <= 0) | (np.abs(delta) >= np.pi / 2)):
        return None
    zeros, ones = np.zeros_like(q), np.ones_like(q)

    def by_all(by_shape: Floats) -> Floats:
        return np.array([*by_shape, zeros, zeros])

    d_theta, d_x, d_y = by_all(contact.d_theta_c), by_all(contact.d_x_c), by_all(contact.d_y_c)
    d_beta = d_theta + by_all(contact.d_lean)
    d_deflection = compliance * rigidity * by_all(contact.d_load)
    d_deflection[3] = rigidity * contact.load
    d_reach = np.array([zeros, zeros, zeros, zeros, ones])
    d_along = d_x + sine * d_reach + reach * cosine * d_theta
    d_along -= force_sine * d_deflection + deflection * force_cosine * d_beta
    d_across = d_y - cosine * d_reach + reach * sine * d_theta
    d_across += force_cosine * d_deflection - deflection * force_sine * d_beta
    d_delta = (delta_cosine * d_across - delta_sine * d_along + d_reach) / slope
    world_sine, world_cosine = np.sin(contact.theta_c - delta), np.cos(contact.theta_c - delta)
    distance = contact.x_c * delta_cosine + contact.y_c * delta_sine + reach * world_sine
    d_distance = (
        delta_cosine * d_x
        + delta_sine * d_y
        + (contact.y_c * delta_cosine - contact.x_c * delta_sine) * d_delta
        + world_sine * d_reach
        + reach * world_cosine * (d_theta - d_delta)
    )
    return Touch(delta, distance, d_delta, d_distance)
