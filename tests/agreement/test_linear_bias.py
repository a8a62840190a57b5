"""How far linear theory errs on the exact beam: the size of the paper's +-2 %."""

import numpy as np
import pytest
from scipy.optimize import brentq, least_squares

from solver.beam_models.linear import unit_deflection
from solver.instrument.arrays import Floats
from tests.simulated import BEAM, pushed_points
from vbaa_bench.mechanics.planar import push


@pytest.mark.parametrize(
    ("x_c", "bias_pct"), [(0.09, 0.9), (0.15, 2.1), (0.21, 5.2)], ids=["90mm", "150mm", "210mm"]
)
def test_linear_least_squares_is_biased_at_20_percent_deflection(
    x_c: float, bias_pct: float
) -> None:
    # The object stands where the contact distance comes out as asked.
    place = brentq(lambda at: push(BEAM, at, deflection=0.2).x_c - x_c, x_c, 1.05 * x_c, xtol=1e-7)
    points, true_x_c, _ = pushed_points(place, 0.2)
    x, y = points.T

    def residuals(p: Floats) -> Floats:
        return np.asarray((p[1] * unit_deflection(x, float(p[0])) - y) * 1e3)

    fit = least_squares(residuals, [true_x_c, 1.0], x_scale=[1e-2, 1.0], xtol=1e-12)
    bias = 100 * (fit.x[0] - true_x_c) / BEAM.length
    assert bias == pytest.approx(bias_pct, abs=0.1)
    # And the fit looks good: a few hundredths of a pixel are left.
    assert np.sqrt(np.mean(fit.fun**2)) * 1e-3 / 0.51e-3 < 0.1
