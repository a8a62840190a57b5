"""What a push has to do with the shapes it makes: the object's point in the world.

The object touches the beam at rest at the distance x0 from the clamp, in a direction that the
motor passes at the onset angle. From there the motor turns the clamp by the pushing angle delta,
about an axis through the clamp (the paper's Assumption 4). The world is described from the beam at
first contact: x along it, y towards the side from which the object pushes. The object is round,
with `reach` [m] from its axis to the beam's centreline: the beam's radius plus its own, that of a
sharp edge being zero. Its axis stands at (x0, -reach), and yields along -y, the normal of the beam
at first contact, by its compliance [m/N] times the force's component along y.

Seen from the clamp the axis lies at (x_c, y_c) - reach n, n = (-sin theta_c, cos theta_c). Turning
by -delta carries it into the world, which gives two equations for a shape:

    y:  -(x_c - a sin theta_c) sin delta + (y_c + a cos theta_c) cos delta = -reach
        with a = compliance F - reach, solved for delta in closed form
    x:  x_c cos delta + y_c sin delta + reach sin(theta_c - delta) = x0

With a sharp rigid edge and a thin beam these are y_c = x_c tan(delta) and x_c = x0 cos(delta).
"""

import math
from dataclasses import dataclass

import numpy as np

from solver.beam_models import exact
from solver.instrument.arrays import Floats


@dataclass(frozen=True)
class Touch:
    """What a shape says of the push, each with its gradient (4,) by (q, lever, compliance, reach).

    `pushing_angle` [rad] by which the clamp must have turned since first contact, and `distance`
    [m], where along the beam at first contact the object then stands.
    """

    pushing_angle: float
    distance: float
    d_pushing_angle: Floats
    d_distance: Floats


def touch(q: float, lever: float, compliance: float, reach: float, rigidity: float) -> Touch | None:
    """The push that makes the exact beam's shape (q, lever), of flexural rigidity [N m^2].

    None where no pushing angle up to a right angle does.
    """
    at = exact.contact(q, lever)
    sine, cosine = math.sin(at.theta_c), math.cos(at.theta_c)
    a = compliance * rigidity * q - reach
    along, across = at.x_c - a * sine, at.y_c + a * cosine
    radius = math.hypot(along, across)
    if abs(reach) >= radius:
        return None
    delta = math.atan2(across, along) + math.asin(reach / radius)
    turned_sine, turned_cosine = math.sin(delta), math.cos(delta)
    slope = along * turned_cosine + across * turned_sine
    if slope <= 0 or abs(delta) >= math.pi / 2:
        return None

    def by_all(by_shape: Floats, by_compliance: float, by_reach: float) -> Floats:
        return np.array([by_shape[0], by_shape[1], by_compliance, by_reach])

    d_theta = by_all(at.d_theta_c, 0.0, 0.0)
    d_x, d_y = by_all(at.d_x_c, 0.0, 0.0), by_all(at.d_y_c, 0.0, 0.0)
    d_a = np.array([compliance * rigidity, 0.0, rigidity * q, -1.0])
    d_reach = np.array([0.0, 0.0, 0.0, 1.0])
    d_along = d_x - sine * d_a - a * cosine * d_theta
    d_across = d_y + cosine * d_a - a * sine * d_theta
    d_delta = (turned_cosine * d_across - turned_sine * d_along + d_reach) / slope
    lean_sine, lean_cosine = math.sin(at.theta_c - delta), math.cos(at.theta_c - delta)
    distance = at.x_c * turned_cosine + at.y_c * turned_sine + reach * lean_sine
    d_distance = (
        turned_cosine * d_x
        + turned_sine * d_y
        + (at.y_c * turned_cosine - at.x_c * turned_sine) * d_delta
        + lean_sine * d_reach
        + reach * lean_cosine * (d_theta - d_delta)
    )
    return Touch(delta, distance, d_delta, d_distance)
