"""Ellipses: their probability, their shape, and their place in the plot of errors."""

import numpy as np
import polars as pl
import pytest

from vbaa_bench.viewer.ellipses import RADIUS, EllipsePlot, ellipse, ellipse_plot

SIGMAS, CORRELATION = (0.3, 2.0), -0.7
COVARIANCE = np.array([[0.09, -0.42], [-0.42, 4.0]])


def test_an_ellipse_contains_95_per_cent_of_normal_errors(random: np.random.Generator) -> None:
    errors = random.multivariate_normal([0, 0], COVARIANCE, 40_000)
    inverse = np.linalg.inv(COVARIANCE)
    inside = np.einsum("ni,ij,nj->n", errors, inverse, errors) < RADIUS**2
    assert inside.mean() == pytest.approx(0.95, abs=0.006)
    line = ellipse(SIGMAS, CORRELATION)
    assert np.einsum("ni,ij,nj->n", line, inverse, line) == pytest.approx(RADIUS**2)
    assert line[0] == pytest.approx(line[-1])


def test_two_fully_correlated_errors_have_a_line() -> None:
    line = ellipse((1.0, 2.0), 1.0)
    assert line[:, 1] == pytest.approx(2 * line[:, 0])


def row(**changes: float | None) -> dict[str, float | None]:
    values: dict[str, float | None] = {
        "x_c_mm": 100.1,
        "x_c_sigma_mm": 0.1,
        "force_n": 0.51,
        "force_sigma_n": 0.01,
        "x_c_force_correlation": 0.0,
    }
    return values | changes


TRUTH = {"x_c_mm": 100.0, "force_n": 0.5}


def test_errors_are_placed_in_divisions() -> None:
    plot = EllipsePlot(x_c_mm=0.05, force_pct=1.0)
    placed = plot.place(row(), TRUTH)
    assert placed is not None
    assert placed.ellipse is not None
    assert placed.point == pytest.approx([2.0, -2.0])  # up is negative
    assert placed.ellipse.max(axis=0) == pytest.approx([2 + 2 * RADIUS, -2 + 2 * RADIUS], rel=1e-3)
    for name in ("x_c_sigma_mm", "force_sigma_n", "x_c_force_correlation"):
        placed = plot.place(row(**{name: None}), TRUTH)
        assert placed is not None
        assert placed.ellipse is None
    for name in ("x_c_mm", "force_n"):
        assert plot.place(row(**{name: None}), TRUTH) is None
        assert plot.place(row(), {**TRUTH, name: None}) is None


def test_the_scale_is_that_of_the_most_accurate_method() -> None:
    def table(sigma_mm: float | None) -> pl.DataFrame:
        frame = pl.DataFrame([row(x_c_sigma_mm=sigma_mm)] * 3)
        return frame.with_columns(pl.col("x_c_sigma_mm").cast(pl.Float64))

    plot = ellipse_plot({"poor": table(3.0), "good": table(0.1), "silent": table(None)})
    # 0.1 mm and 2 % times the radius 2.45 over two divisions, rounded up to 1, 2 or 5.
    assert plot == pytest.approx((0.2, 5.0))
    assert ellipse_plot({"silent": table(None)}) == pytest.approx((2.0, 2.0))
    assert ellipse_plot({}) == pytest.approx((2.0, 2.0))
