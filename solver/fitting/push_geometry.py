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

from typing import NamedTuple

import numpy as np

from solver.instrument.arrays import Floats


class ShapeContacts(NamedTuple):
    """Contacts of n shapes, `values` (6, n), with `gradients` (6, k, n) by k parameters.

    They are (force over EI, theta_c, x_c, y_c, s_c, lean), as in `beams.beam.BentBeam`, in SI.
    """

    values: Floats
    gradients: Floats


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


def about_axis(contacts: ShapeContacts, offset: Floats) -> ShapeContacts:
    """Return contacts relative to the motor's axis, of a clamp at `offset` (2,) [m] from it.

    The last two gradients are by the offset.
    """
    values = contacts.values.copy()
    values[2:4] += offset[:, None]
    by_offset = np.zeros((len(values), 2, values.shape[1]))
    by_offset[2, 0] = by_offset[3, 1] = 1.0
    return ShapeContacts(values, np.concatenate([contacts.gradients, by_offset], axis=1))


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


class Touch(NamedTuple):
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
    contacts: ShapeContacts, first: FirstTouch, compliance: float, reach: float, rigidity: float
) -> Touch | None:
    """Compute the pushes that make shapes with these contacts (n,), of a beam with EI `rigidity`.

    The gradients (k, n) of the contacts are by q, place, friction ratio and the beam's parameters.
    Returns None if no pushing angle below a right angle makes a shape.
    """
    load, theta, x, y, _, lean = contacts.values
    beta = theta + lean
    deflection = compliance * rigidity * load
    along = x + reach * np.sin(theta) - deflection * np.sin(beta)
    across = y - reach * np.cos(theta) + deflection * np.cos(beta)
    radius = np.hypot(along, across)
    offset = reach - first.height
    if np.any(abs(offset) >= radius):
        return None
    delta = np.arctan2(across, along) + np.arcsin(offset / radius)
    sine, cosine = np.sin(delta), np.cos(delta)
    slope = along * cosine + across * sine
    if np.any((slope <= 0) | (np.abs(delta) >= np.pi / 2)):
        return None
    # In the world, the normal at the contact is turned by theta_c - delta, the force by its lean
    # more.
    normal_sine, normal_cosine = np.sin(theta - delta), np.cos(theta - delta)
    force_sine, force_cosine = np.sin(beta - delta), np.cos(beta - delta)
    n, k = len(delta), contacts.gradients.shape[1]
    zero = np.zeros(n)
    # Derivatives of delta, and of the excess with delta held, by the contacts' six quantities.
    by_lean = -deflection * force_sine
    of_delta = np.array(
        [
            compliance * rigidity * force_cosine,
            reach * normal_sine + by_lean,
            -sine,
            cosine,
            zero,
            by_lean,
        ]
    )
    of_excess = np.array([zero, reach * normal_cosine, cosine, sine, zero, zero])
    by = np.zeros((2, k + 3, n))
    np.einsum("cn,ckn->kn", of_delta, contacts.gradients, out=by[0, :k])
    np.einsum("cn,ckn->kn", of_excess, contacts.gradients, out=by[1, :k])
    by[0, k], by[0, k + 1] = rigidity * load * force_cosine, 1 - normal_cosine
    by[1, k + 1] = normal_sine
    by_first = np.zeros((3, k + 3, 1))
    by_first[:, k + 2, 0], by_first[:, 3:k, 0] = first.gradients[:, 0], first.gradients[:, 1:]
    by[0] = (by[0] - by_first[1]) / slope
    by[1] += (y * cosine - x * sine - reach * normal_cosine) * by[0] - by_first[0]
    by[0] -= by_first[2]
    excess = x * cosine + y * sine + reach * normal_sine - first.position
    return Touch(delta - first.angle, excess, by[0], by[1])
