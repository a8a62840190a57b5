"""Un-projection from the calibration plane C to the deformation plane D, eqs. (7) and (8).

With the viewpoint in homogeneous coordinates, V = (X, Y, Z, w), one form serves a pinhole (w = 1,
the paper's) and a telecentric camera (w = 0). The ray through (x, y) on C meets the plane that
is inclined by psi at

    x_d = x + y sin(psi) (X - w x) / g,    y_d = Z y / g,    g = Z cos(psi) + (w y - Y) sin(psi).

Both are singular where the camera looks along D (edge-on), tan(psi) = Z / Y.
"""

import math
from dataclasses import replace

import numpy as np

from solver.instrument.arrays import Floats
from solver.instrument.estimate import Estimate, Outcome
from solver.instrument.measurement import UNKNOWN_VIEWPOINT, Measurement, View

# Sine of the minimum angle between the line of sight and D. There errors grow fifty times, and a
# degree in psi decides which side of the beam is visible.
MIN_OPENING = 0.02


def opening(viewpoint: Floats, psi: float) -> float:
    """Compute the sine of the angle between D and the line from the clamp to V (4,)."""
    _, y, z, _ = viewpoint
    return float((z * math.cos(psi) - y * math.sin(psi)) / math.hypot(y, z))


def unproject(points: Floats, viewpoint: Floats, psi: float) -> tuple[Floats, Floats, Floats]:
    """Un-project points from C to D.

    `points` (n, 2) [m] are on C, `viewpoint` (4,) is V. Return the points on D (n, 2) [m], their
    derivatives by the points on C (n, 2, 2), and by psi (n, 2). A point whose ray meets D only
    behind the camera is infinite.
    """
    x, y = points.T
    vx, vy, vz, w = viewpoint
    sine, cosine = math.sin(psi), math.cos(psi)
    g = vz * cosine + (w * y - vy) * sine
    edge = vz * cosine - vy * sine  # g at the clamp
    visible = g * edge > 0
    g = np.where(visible, g, 1.0)
    lateral = vx - w * x
    on_d = np.column_stack([x + y * sine * lateral / g, vz * y / g])
    on_d[~visible] = np.inf
    by_point = np.empty((len(points), 2, 2))
    by_point[:, 0, 0] = 1 - w * y * sine / g
    by_point[:, 0, 1] = sine * lateral * edge / g**2
    by_point[:, 1, 0] = 0.0
    by_point[:, 1, 1] = vz * edge / g**2
    g_by_psi = (w * y - vy) * cosine - vz * sine  # dg / dpsi
    by_psi = np.column_stack([vz * y * lateral, -vz * y * g_by_psi]) / g[:, None] ** 2
    return on_d, by_point, by_psi


def on_deformation_plane(measurement: Measurement, psi: float) -> Measurement | None:
    """Transform a measurement from C to D; return None where the camera sees D edge-on.

    Its frame is that of the beam at rest, turned about x by `psi` [rad] so that D is its plane
    z = 0: points, their errors, the viewpoint, the clamp's covariance and `antenna_from_beam` are
    transformed to it. A planar method then applies unchanged. Rays that meet D only behind the
    camera are left out. Earlier frames and the tip are dropped.
    """
    if psi == 0.0:
        return measurement
    view = measurement.view
    if abs(opening(view.viewpoint, psi)) < MIN_OPENING:
        return None
    points, by_point, _ = unproject(view.points, view.viewpoint, psi)
    visible = np.isfinite(points[:, 0])
    sigma_vectors = np.einsum("nij,nj->ni", by_point, view.sigma_vectors)
    sine, cosine = math.sin(psi), math.cos(psi)
    antenna_from_beam = measurement.antenna_from_beam.copy()
    turn = np.array([[1, 0, 0], [0, cosine, -sine], [0, sine, cosine]])
    antenna_from_beam[:3, :3] = antenna_from_beam[:3, :3] @ turn
    viewpoint = np.append(turn.T @ view.viewpoint[:3], view.viewpoint[3])
    # The clamp's uncertainty is carried from C to D along the ray at the clamp.
    vx, vy, vz, _ = view.viewpoint
    edge = vz * cosine - vy * sine
    clamp = np.diag([1.0, vz / edge, vz / edge])
    clamp[0, 1] = sine * vx / edge
    return replace(
        measurement,
        view=View(
            points[visible],
            sigma_vectors[visible],
            viewpoint,
            shared_errors=view.shared_errors[visible],
            lost_light=view.lost_light[visible],
        ),
        base_covariance=clamp @ measurement.base_covariance @ clamp.T,
        image_shift=clamp[:2, :2] @ measurement.image_shift @ clamp[:2, :2].T,
        antenna_from_beam=antenna_from_beam,
        earlier=(),
    )


def known_plane(measurement: Measurement) -> tuple[Measurement, float] | Estimate:
    """Transform a measurement to the rig's known bending plane; return it and the inclination.

    That plane is C (psi = 0) unless the rig states `known_psi` [rad], as for a flat strip
    (section V-A). The inclination is counted in the frame of the beam at rest, a reflection of
    Sigma_a where the rig deflects towards -y. Return an Estimate with a failure outcome where the
    camera sees the plane edge-on, or the viewpoint is needed and not known.
    """
    if measurement.rig.known_psi and not measurement.viewpoint_known:
        return Estimate(Outcome.NOT_IDENTIFIABLE, UNKNOWN_VIEWPOINT)
    psi = (measurement.rig.known_psi or 0.0) * measurement.handedness
    planar = on_deformation_plane(measurement, psi)
    if planar is None:
        return Estimate(
            Outcome.EDGE_ON, f"the plane inclined by {math.degrees(psi):.1f} deg is seen edge-on"
        )
    return planar, psi
