"""Quantities that are limited, and their change with the parameters of the loaded beam."""

from collections.abc import Mapping
from typing import Final, NamedTuple

import numpy as np

from solver.instrument.arrays import Floats
from vbaa_bench.limits.imaged_beam import ImagedBeam, Neighbours

# Those of a second contact: its arc length [m] and its force [N].
SECOND: Final = ("second_s_c", "second_force")
# Contact distance x_c and arc length s_c [m], size of the force [N], inclination psi [rad] of the
# plane in which the contact has moved, and SECOND; then what sensors at the clamp read: force [N]
# and moment [N m] of the clamp on the beam, each (3,).
QUANTITIES: Final = ("x_c", "s_c", "force", "psi", *SECOND)


class Gradients(NamedTuple):
    """Gradients with respect to p parameters: of QUANTITIES (6, p), and of the readings (6, p)."""

    quantities: Floats
    readings: Floats


def gradients(neighbours: Mapping[str, Neighbours], at_rest: Floats) -> Gradients:
    """Differentiate QUANTITIES and readings by p parameters. Raises EquilibriumError.

    `at_rest` (3,) [m] is the place of the contact on the beam before contact.
    """
    columns = [
        difference(one.ahead, one.behind, at_rest) / one.difference for one in neighbours.values()
    ]
    together = np.array(columns).T
    return Gradients(together[: len(QUANTITIES)], together[len(QUANTITIES) :])


def difference(one: ImagedBeam, other: ImagedBeam, at_rest: Floats) -> Floats:
    """Subtract QUANTITIES and readings (12,) of two beams. Raises EquilibriumError.

    Quantities of a second contact that does not exist are 0.
    """
    change = _values(one, at_rest) - _values(other, at_rest)
    # psi is an angle.
    change[3] = (change[3] + np.pi) % (2 * np.pi) - np.pi
    return change


def _values(imaged: ImagedBeam, at_rest: Floats) -> Floats:
    beam = imaged.beam
    point, force = beam.points[0], beam.forces[0]
    _, y, z = point - at_rest
    size, psi = float(np.linalg.norm(force)), float(np.arctan2(z, y))
    second = [0.0, 0.0]
    if len(imaged.loads) > 1:
        second = [imaged.loads[1].s, float(np.linalg.norm(beam.forces[1]))]
    quantities = [point[0], imaged.loads[0].s, size, psi, *second]
    return np.array([*quantities, *-beam.forces.sum(axis=0), *beam.base_moment])
