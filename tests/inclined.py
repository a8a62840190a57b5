"""Measurements without images of a beam that bends in an inclined plane, as seen on C."""

import dataclasses

import numpy as np

from solver.instrument.arrays import Floats
from solver.instrument.measurement import Measurement, View
from solver.instrument.rig import Sensors
from tests.simulated import BEAM, columns, measurement
from vbaa_bench.mechanics.planar import push

VIEWPOINT = np.array([0.12, 0.0, 0.36, 1.0])


def on_plane_c(points: Floats, psi: float, viewpoint: Floats) -> Floats:
    """Where the rays from V (4,) to points (n, 2) of D meet C, (n, 2): similar triangles, (6)."""
    there = np.column_stack([points[:, 0], points[:, 1] * np.cos(psi), points[:, 1] * np.sin(psi)])
    direction = viewpoint[:3] - viewpoint[3] * there
    met = there - there[:, 2:] / direction[:, 2:] * direction
    return np.asarray(met[:, :2])


def pushed(
    contact_distance: float, deflection: float, psi: float, viewpoint: Floats = VIEWPOINT
) -> tuple[Floats, dict[str, float]]:
    """Noise-free columns on C of the exact beam, and the truth by the estimate's names.

    `moment_y` of the truth [N m] is what the beam exerts on the sensor.
    """
    state = push(BEAM, contact_distance, deflection=deflection, intervals=20_000)
    seen = state.centreline.copy()
    seen[:, 1:3] = on_plane_c(seen[:, 1:3], psi, viewpoint)
    place, force = state.contact.point, state.contact.force
    x_c, y_c, size = float(place[0]), float(place[1]), float(np.linalg.norm(force))
    truth = {
        "x_c_m": x_c,
        "y_c_m": y_c,
        "force_n": size,
        "psi_rad": psi,
        "contact_antenna_y_m": y_c * np.cos(psi),
        "contact_antenna_z_m": y_c * np.sin(psi),
        "force_y_n": float(force[1]) * np.cos(psi),
        "force_z_n": float(force[1]) * np.sin(psi),
        "moment_y": (y_c * float(force[0]) - x_c * float(force[1])) * np.sin(psi),
    }
    return columns(seen), truth


def inclined(
    points: Floats,
    sigma: float,
    *,
    viewpoint: Floats = VIEWPOINT,
    base_sigma: float = 0.0,
    moment_y: float | None = None,
    moment_sigma: float | None = None,
    known_psi: float | None = None,
) -> Measurement:
    """Points on C with error `sigma` [m] along y, and what the sensor reads [N m]."""
    plain = measurement(points, sigma, base_sigma)
    rig = dataclasses.replace(plain.rig, known_psi=known_psi, sensors=Sensors(moment_sigma))
    view = View(points, plain.sigma_vectors, viewpoint)
    return dataclasses.replace(plain, view=view, rig=rig, moment_y=moment_y)
