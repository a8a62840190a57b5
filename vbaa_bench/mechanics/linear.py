"""The paper's analytic beam, eqs. (9) and (10), as a forward model.

Under a force f across the beam at x_c its shape in the deformation plane is

    y_d(x) = f x^2 (3 x_c - x) / (6 EI)      up to the contact,
    y_d(x) = f x_c^2 (3 x - x_c) / (6 EI)    beyond, straight.

In linear theory arc length equals x, and the contact stays at x_c. With this truth the paper's
methods have no model error.
"""

import math

import numpy as np

from solver.instrument.beam import Beam
from vbaa_bench.mechanics.state import Contact, EquilibriumError, State


def push(
    beam: Beam,
    contact_distance: float,
    *,
    deflection: float | None = None,
    pushing_angle: float | None = None,
    normal_angle: float = 0.0,
    compliance: float = 0.0,
    intervals: int = 480,
) -> State:
    """Push until y_d(L) / L is `deflection`, or until the clamp has turned by `pushing_angle`.

    The object is in the world at `contact_distance` [m]. Its surface's normal, and with it the
    deformation plane, is inclined by `normal_angle` [rad] to plane C, and it yields by
    `compliance` [m/N] along that normal. The clamp's turn brings it x_c tan(dtheta) nearer: the
    paper's (30), corrected. Given `deflection`, the angle [rad] follows from it. The centreline
    has `intervals` + 1 rows, one of them exactly at the contact. Raises EquilibriumError if the
    contact is not on the beam.
    """
    if (deflection is None) == (pushing_angle is None):
        raise ValueError("give one of deflection and pushing_angle")
    x_c, length, rigidity = contact_distance, beam.length, beam.flexural_rigidity
    if not 0 < x_c < length:
        raise EquilibriumError(
            f"contact distance {x_c:.6g} m is not on the beam, allowed is up to {length:.6g} m"
        )
    normal = np.array([0.0, math.cos(normal_angle), math.sin(normal_angle)])
    give = x_c**3 / (3 * rigidity) + compliance  # of beam and object together, [m/N]
    if deflection is not None:
        f = 6 * rigidity * deflection * length / (x_c**2 * (3 * length - x_c))
        angle = math.atan(f * give / (x_c * normal[1]))
    else:
        angle = pushing_angle or 0.0
        f = x_c * math.tan(angle) * normal[1] / give
    row = min(max(round(x_c / length * intervals), 1), intervals - 1)
    ahead = np.linspace(x_c, length, intervals - row + 1)[1:]
    x = np.concatenate([np.linspace(0.0, x_c, row + 1), ahead])
    y_d = f / (6 * rigidity) * np.where(x <= x_c, x**2 * (3 * x_c - x), x_c**2 * (3 * x - x_c))
    line = np.column_stack([x, x, np.outer(y_d, normal[1:])])
    slope = f * x_c**2 / (2 * rigidity)
    tangent = np.array([1.0, 0.0, 0.0]) + slope * normal
    force = f * normal
    contact = Contact(
        s=x_c,
        point=line[row, 1:],
        tangent=tangent / np.linalg.norm(tangent),
        normal=normal,
        lever=-beam.radius * normal,
        force=force,
        object_shift=-compliance * force,
        row=row,
    )
    return State(
        pushing_angle=angle,
        contacts=(contact,),
        base_force=-force,
        base_moment=-np.cross([x_c, 0.0, 0.0], force),
        centreline=line,
        director=None,
        largest_strain=abs(f) * x_c / rigidity * beam.radius,
        residual=0.0,
    )
