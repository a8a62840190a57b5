"""Measurements of beams that are not uniform, computed by the world's rod, without images."""

from dataclasses import replace
from functools import lru_cache

import numpy as np

from solver.instrument.arrays import Floats
from solver.instrument.beam_shape import BeamShape
from solver.instrument.measurement import Measurement, RestBow, View
from tests.simulated import BEAM, columns, measurement
from vbaa_bench.mechanics.loaded import Load, LoadedBeam, loaded
from vbaa_bench.mechanics.rod import Rod

SIGMA = 0.01 * 0.51e-3  # a hundredth of a pixel [m]
BASE_SIGMA = 2e-6


@lru_cache(maxsize=64)
def bent(taper: float, place: float, load: float, friction: float = 0.0) -> LoadedBeam:
    """The world's cone under a load [EI / L^2] at an arc length `place` [L]."""
    length = BEAM.length
    force = load * BEAM.flexural_rigidity / length**2
    return loaded(
        Rod(BEAM, tip_ratio=1 + taper),
        [Load(place * length, force, friction=(friction, 0.0))],
        # Linear interpolation between 0.24 mm errs by 40 nm, 0.8 % of SIGMA.
        np.linspace(0.0, length, 1001),
    )


def measured(
    beam: LoadedBeam, shape: BeamShape, random: np.random.Generator, tilt: float = 0.0
) -> Measurement:
    """Columns with noise of a beam, whose clamp has turned by `tilt` [rad]."""
    turned, (c, s) = beam.centreline.copy(), (np.cos(tilt), np.sin(tilt))
    turned[:, 1:3] = beam.centreline[:, 1:3] @ np.array([[c, s], [-s, c]])
    points = columns(turned)
    points[:, 1] += SIGMA * random.standard_normal(len(points))
    taken = measurement(points, SIGMA, base_sigma=BASE_SIGMA)
    return replace(taken, rig=replace(taken.rig, shape=shape))


def bowed(
    points: Floats, removed: Floats, bow: Floats, by_weight: Floats, shape: BeamShape
) -> Measurement:
    """Columns (n, 2) of a beam with a known bow, from which `removed` (n, 2) is subtracted.

    `bow` and `by_weight` (3,) [m] are its coefficients at rest and their change since then.
    """
    length, n = BEAM.length, len(points)
    taken = measurement(points - removed, SIGMA, base_sigma=BASE_SIGMA)
    rest = RestBow(
        coefficients=bow,
        by_weight=by_weight,
        covariance=np.diag([SIGMA, SIGMA / length, SIGMA, SIGMA, SIGMA]) ** 2 / n,
        line_covariance=np.diag([SIGMA, SIGMA / length]) ** 2 / n,
        removed=removed,
        scale_sigma=0.0,
        errors=0,
    )
    view = View(points - removed, taken.sigma_vectors, taken.view.viewpoint)
    return replace(taken, view=view, rig=replace(taken.rig, shape=shape), rest_bow=rest)
