"""Relate beam shapes to the push that makes them, by the object's position in the world.

The object touches the beam at rest at the distance x0 from the clamp, when the motor is at the
onset angle. From there the motor turns the clamp by the pushing angle delta, about its axis, which
is taken to pass through the clamp (the paper's Assumption 4); `about_axis` and `first_about_axis`
refer contacts of a clamp beside the axis to the axis. The world frame is given by the beam at first
contact: x is
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

A bowed beam is inclined to its clamp by an angle at first contact, which delta then contains, and
its tangent there passes the clamp at a distance: the y equation has -reach + height on its right.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from solver.beams.frictional import Contact
from solver.instrument.arrays import Floats


class FirstTouch(NamedTuple):
    """Line of the beam at the point of first contact, in the frame of the clamp.

    `position` [m] is along the line, `height` [m] the distance of the line above the clamp, and
    `angle` [rad] its inclination. `gradients` (3, 1 + b) are those of the three by x0 and the b
    parameters of the beam.
    """

    position: float
    height: float
    angle: float
    gradients: Floats


def about_axis(contact: Contact, offset: Floats) -> Contact:
    """Return contacts relative to the motor's axis, of a clamp at `offset` (2,) [m] from it.

    The last two gradients are by the offset.
    """

    def with_offset(gradient: Floats, by_offset: tuple[float, float] = (0.0, 0.0)) -> Floats:
        longer = np.empty((len(gradient) + 2, gradient.shape[1]))
        longer[:-2], longer[-2], longer[-1] = gradient, *by_offset
        return longer

    return replace(
        contact,
        x_c=contact.x_c + offset[0],
        y_c=contact.y_c + offset[1],
        d_load=with_offset(contact.d_load),
        d_theta_c=with_offset(contact.d_theta_c),
        d_lean=with_offset(contact.d_lean),
        d_x_c=with_offset(contact.d_x_c, (1.0, 0.0)),
        d_y_c=with_offset(contact.d_y_c, (0.0, 1.0)),
        d_s_c=with_offset(contact.d_s_c),
    )


def first_about_axis(first: FirstTouch, offset: Floats) -> FirstTouch:
    """Return the line of first contact relative to the motor's axis, as `about_axis`."""
    sine, cosine = np.sin(first.angle), np.cos(first.angle)
    along, across = cosine * offset[0] + sine * offset[1], cosine * offset[1] - sine * offset[0]
    gradients = first.gradients.copy()
    gradients[0] += across * gradients[2]
    gradients[1] -= along * gradients[2]
    by_offset = np.array([[cosine, sine], [-sine, cosine], [0.0, 0.0]])
    gradients = np.hstack([gradients, by_offset])
    return FirstTouch(
        float(first.position + along), float(first.height + across), first.angle, gradients
    )


@dataclass(frozen=True)
class Touch:
    """Pushes that make shapes (n,), each quantity with its gradient (k + 3, n).

    `pushing_angle` [rad] is the clamp's rotation since first contact, `excess` [m] the object's
    position along the beam at first contact, less where it is. Gradients are by the k parameters of
    the contact, compliance, reach and x0.
    """

    pushing_angle: Floats
    excess: Floats
    d_pushing_angle: Floats
    d_excess: Floats


def touch(
    contact: Contact, first: FirstTouch, compliance: float, reach: float, rigidity: float
) -> Touch | None:
    """Compute the pushes that make shapes with these contacts (n,), of a beam with EI `rigidity`.

    The gradients (k, n) of the contacts are by q, place, friction ratio and the beam's parameters.
    Returns None if no pushing angle below a right angle makes a shape.
    """
    sine, cosine = np.sin(contact.theta_c), np.cos(contact.theta_c)
    force_sine, force_cosine = (
        np.sin(contact.theta_c + contact.lean),
        np.cos(contact.theta_c + contact.lean),
    )
    deflection = compliance * rigidity * contact.load
    along = contact.x_c + reach * sine - deflection * force_sine
    across = contact.y_c - reach * cosine + deflection * force_cosine
    radius = np.hypot(along, across)
    offset = reach - first.height
    if np.any(abs(offset) >= radius):
        return None
    delta = np.arctan2(across, along) + np.arcsin(offset / radius)
    delta_sine, delta_cosine = np.sin(delta), np.cos(delta)
    slope = along * delta_cosine + across * delta_sine
    if np.any((slope <= 0) | (np.abs(delta) >= np.pi / 2)):
        return None
    n, k = len(delta), len(contact.d_x_c)

    def by_all(by_contact: Floats) -> Floats:
        return np.concatenate([by_contact, np.zeros((3, n))])

    d_theta, d_x, d_y = by_all(contact.d_theta_c), by_all(contact.d_x_c), by_all(contact.d_y_c)
    d_beta = d_theta + by_all(contact.d_lean)
    d_deflection = compliance * rigidity * by_all(contact.d_load)
    d_deflection[k] = rigidity * contact.load
    d_reach, d_first = np.zeros((k + 3, 1)), np.zeros((3, k + 3, 1))
    d_reach[k + 1] = 1.0
    d_first[:, k + 2, 0], d_first[:, 3:k, 0] = first.gradients[:, 0], first.gradients[:, 1:]
    d_position, d_height, d_angle = d_first
    d_along = d_x + sine * d_reach + reach * cosine * d_theta
    d_along -= force_sine * d_deflection + deflection * force_cosine * d_beta
    d_across = d_y - cosine * d_reach + reach * sine * d_theta
    d_across += force_cosine * d_deflection - deflection * force_sine * d_beta
    d_delta = (delta_cosine * d_across - delta_sine * d_along + (d_reach - d_height)) / slope
    world_sine, world_cosine = np.sin(contact.theta_c - delta), np.cos(contact.theta_c - delta)
    distance = contact.x_c * delta_cosine + contact.y_c * delta_sine + reach * world_sine
    d_distance = (
        delta_cosine * d_x
        + delta_sine * d_y
        + (contact.y_c * delta_cosine - contact.x_c * delta_sine) * d_delta
        + world_sine * d_reach
        + reach * world_cosine * (d_theta - d_delta)
    )
    return Touch(
        delta - first.angle, distance - first.position, d_delta - d_angle, d_distance - d_position
    )
