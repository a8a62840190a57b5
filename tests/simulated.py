"""Measurements of a bent beam without images: points on the exact beam, with known noise."""

import numpy as np

from solver.instrument.arrays import Floats
from solver.instrument.beam import Beam, circular_rigidity
from solver.instrument.board import Chessboard
from solver.instrument.measurement import Measurement, View
from solver.instrument.rig import Rig, Tolerances
from vbaa_bench.mechanics.planar import push

BEAM = Beam(0.24, 0.8e-3, circular_rigidity(200e9, 0.8e-3))


def rig(**tolerances: float) -> Rig:
    """The reference rig; tolerances are zero unless given."""
    zero = dict.fromkeys(Tolerances.__dataclass_fields__, 0.0)
    return Rig(
        beam=BEAM,
        base_position=np.zeros(3),
        board=Chessboard(12, 9, 0.018),
        antenna_from_board=np.eye(4),
        deflects_towards=1,
        tolerances=Tolerances(**{**zero, **tolerances}),
    )


def columns(centreline: Floats, spacing: float = 0.51e-3, start: float = 3e-3) -> Floats:
    """Points (n, 2) of a dense centreline (n, 4) at evenly spaced x, as image columns give them."""
    x = np.arange(start, centreline[-1, 1], spacing)
    return np.column_stack([x, np.interp(x, centreline[:, 1], centreline[:, 2])])


def measurement(
    points: Floats, sigma: float, base_sigma: float = 0.0, scale_sigma: float = 0.0
) -> Measurement:
    """Points with error `sigma` [m] along y; clamp known to `base_sigma` [m], ten times [rad]."""
    across = np.column_stack([np.zeros(len(points)), np.full(len(points), sigma)])
    variance = max(base_sigma, 1e-9) ** 2
    return Measurement(
        view=View(points, across, np.array([0.12, 0.0, 0.36, 1.0])),
        base_covariance=np.diag([variance, variance, 100 * variance]),
        scale_sigma=scale_sigma,
        motor_angle=0.0,
        rig=rig(),
    )


def pushed_points(contact_distance: float, deflection: float) -> tuple[Floats, float, float]:
    """Noise-free columns of the exact beam, its x_c [m] and force [N]."""
    # 20,000 pieces: linear interpolation between them errs by less than a nanometre.
    state = push(BEAM, contact_distance, deflection=deflection, intervals=20_000)
    contact = state.contact
    return columns(state.centreline), float(contact.point[0]), float(np.linalg.norm(contact.force))
