"""How far linear theory errs on the exact beam: the size of the paper's +-2 %; and on its own, not
at all."""

import numpy as np
import pytest
from scipy.optimize import OptimizeResult, brentq, least_squares

from solver.beams.linear import unit_deflection
from solver.instrument.arrays import Floats
from tests.consistency import MOST_SIGMAS
from tests.simulated import BEAM, columns, pushed_points
from vbaa_bench.mechanics import linear, planar


def fitted(points: Floats, start: float) -> OptimizeResult:
    """x_c [m] and amplitude by least squares on linear theory; residuals in millimetres."""
    x, y = points.T

    def residuals(p: Floats) -> Floats:
        return np.asarray((p[1] * unit_deflection(x, float(p[0])) - y) * 1e3)

    return least_squares(residuals, [start, 1.0], x_scale=[1e-2, 1.0], xtol=1e-12)


@pytest.mark.parametrize(
    ("x_c", "bias_pct"), [(0.09, 0.9), (0.15, 2.1), (0.21, 5.2)], ids=["90mm", "150mm", "210mm"]
)
def test_linear_least_squares_is_biased_at_20_percent_deflection(
    x_c: float, bias_pct: float
) -> None:
    # The object stands where the contact distance comes out as asked.
    def excess(place: float) -> float:
        return float(planar.push(BEAM, place, deflection=0.2).contact.point[0]) - x_c

    points, true_x_c, _ = pushed_points(brentq(excess, x_c, 1.05 * x_c, xtol=1e-7), 0.2)
    fit = fitted(points, true_x_c)
    bias = 100 * (fit.x[0] - true_x_c) / BEAM.length
    assert bias == pytest.approx(bias_pct, abs=0.1)
    # And the fit looks good: a few hundredths of a pixel are left.
    assert np.sqrt(np.mean(fit.fun**2)) * 1e-3 / 0.51e-3 < 0.1


@pytest.mark.parametrize("x_c", [0.09, 0.15, 0.21])
@pytest.mark.parametrize("deflection", [0.05, 0.2])
def test_linear_least_squares_is_unbiased_on_the_linear_beam(x_c: float, deflection: float) -> None:
    state = linear.push(BEAM, x_c, deflection=deflection, intervals=20_000)
    fit = fitted(columns(state.centreline), 0.9 * x_c)
    assert fit.x[0] == pytest.approx(x_c, abs=1e-6 * BEAM.length)
    assert 6 * BEAM.flexural_rigidity * fit.x[1] == pytest.approx(
        float(np.linalg.norm(state.contact.force)), rel=1e-5
    )


@pytest.mark.parametrize("x_c", [0.09, 0.15, 0.21])
def test_with_noise_it_is_unbiased_still(x_c: float, random: np.random.Generator) -> None:
    state = linear.push(BEAM, x_c, deflection=0.2, intervals=20_000)
    points = columns(state.centreline)
    sigma, found = 0.05 * 0.51e-3, []
    for _ in range(60):
        noise = np.column_stack([np.zeros(len(points)), random.normal(0.0, sigma, len(points))])
        found.append(float(fitted(points + noise, x_c).x[0]) - x_c)
    error = np.std(found) / np.sqrt(len(found))
    assert abs(np.mean(found)) < MOST_SIGMAS * error
    assert error < 2e-4 * BEAM.length  # where the exact beam's bias is a hundred times that
