"""Measurements of a beam that bends out of plane C, seen through a pinhole, without images."""

import math
from dataclasses import replace
from functools import cache

import numpy as np

from solver.instrument.arrays import Floats
from solver.instrument.measurement import Measurement, Tip, View
from solver.instrument.rig import Sensors
from tests.simulated import BEAM, rig
from tests.vbaa_bench.mechanics.benches import obstacle, push_one
from vbaa_bench.mechanics.rod import Rod
from vbaa_bench.mechanics.state import State

PIXEL = 0.51e-3  # on plane C [m]
ABOVE_MIDDLE = np.array([0.12, 0.0, 0.36, 1.0])
BEHIND = np.array([-0.12, 0.0, 0.36, 1.0])


@cache
def pushed(contact: float, deflection: float, psi: float) -> State:
    """The world's rod in space against an edge that leans by `psi` [rad]."""
    rod = Rod(BEAM)
    return push_one(
        rod, obstacle(BEAM, contact, nu=psi), contact, deflection=deflection, intervals=2000
    )


def on_plane(points: Floats, viewpoint: Floats) -> Floats:
    """Where the rays from the viewpoint (4,) to points (n, 3) meet C (n, 2)."""
    towards = viewpoint[:3] - viewpoint[3] * points
    return np.asarray((points - (points[:, 2] / towards[:, 2])[:, None] * towards)[:, :2])


def view(
    state: State,
    viewpoint: Floats = ABOVE_MIDDLE,
    *,
    sigma: float = 0.05 * PIXEL,
    tip: bool = False,
    random: np.random.Generator | None = None,
) -> View:
    """Columns of the beam's image on C, with errors of `sigma` [m] along y, and of its tip."""
    seen = on_plane(state.centreline[:, 1:], viewpoint)
    x = np.arange(seen[0, 0] + 3e-3, seen[-1, 0], PIXEL)
    y = np.interp(x, seen[:, 0], seen[:, 1])
    end = seen[-1]
    if random is not None:
        y = y + sigma * random.standard_normal(len(x))
        end = end + sigma * random.standard_normal(2)
    sigmas = np.column_stack([np.zeros(len(x)), np.full(len(x), sigma)])
    where = Tip(end, sigma**2 * np.eye(2)) if tip else None
    return View(np.column_stack([x, y]), sigmas, viewpoint, where)


def measured(
    seen: View,
    *,
    moment: tuple[float, float] | None = None,
    base_sigma: float = 1e-9,
) -> Measurement:
    """A measurement of this view; `moment` is the sensor's reading and sigma [N m]."""
    nominal = rig()
    if moment is not None:
        nominal = replace(nominal, sensors=Sensors(moment_y=moment[1]))
    return Measurement(
        view=seen,
        base_covariance=np.diag([base_sigma, base_sigma, 10 * base_sigma]) ** 2,
        scale_sigma=0.0,
        motor_angle=0.0,
        rig=nominal,
        moment_y=None if moment is None else moment[0],
    )


def plane_of(state: State) -> float:
    """Psi [rad] of a state: the plane in which its contact has moved."""
    return math.atan2(state.contact.point[2], state.contact.point[1])
