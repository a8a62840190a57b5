"""Charts of stated sigmas against errors, and of the errors of psi and compliance."""

from collections.abc import Mapping
from typing import Final

import altair as alt
import numpy as np
import polars as pl
from scipy.special import erf

from vbaa_bench.report.figures import Chart, sample_dots
from vbaa_bench.scoring.scored_quantities import SCORED_QUANTITIES, ScoredQuantity

_LABELS: Final = {"x_c": "contact distance", "force": "force", "psi": "psi", "compliance": "1/k_s"}
_MAX_SIGMAS = 4.0
_WIDTH, _HEIGHT = 300, 240


def _colour(scores: pl.DataFrame, colours: Mapping[str, str]) -> alt.Color:
    names = scores["method"].unique(maintain_order=True).to_list()
    scale = alt.Scale(domain=names, range=[colours[name] for name in names])
    return alt.Color("method:N", title=None, scale=scale).legend(orient="bottom", columns=3)


def calibrations(scores: pl.DataFrame, colours: Mapping[str, str]) -> list[Chart]:
    """Plot the fraction of frames within n stated sigmas, for each quantity with stated sigmas.

    The black line is the fraction for consistent Gaussian errors; above it sigmas are too large,
    below it too small.
    """
    stated = [
        quantity
        for quantity in SCORED_QUANTITIES
        if quantity.name in _LABELS and quantity.in_sigmas in scores.columns
    ]
    return [
        _coverage(scores.drop_nulls(quantity.in_sigmas), quantity, colours)
        for quantity in stated
        if scores[quantity.in_sigmas].is_not_null().any()
    ]


def _coverage(scores: pl.DataFrame, quantity: ScoredQuantity, colours: Mapping[str, str]) -> Chart:
    grid = np.linspace(0, _MAX_SIGMAS, 81)
    curves = []
    for (name,), rows in scores.group_by("method", maintain_order=True):
        size = np.sort(np.abs(rows[quantity.in_sigmas].to_numpy()))
        fraction = np.searchsorted(size, grid, side="right") / len(size)
        curves.append(
            pl.DataFrame({"method": [str(name)] * len(grid), "sigmas": grid, "share": fraction})
        )
    expected = pl.DataFrame({"sigmas": grid, "share": erf(grid / np.sqrt(2))})
    x = alt.X("sigmas:Q", title="stated sigmas")
    y = alt.Y("share:Q", title="fraction of frames within").scale(domain=[0, 1])
    return alt.layer(
        alt.Chart(expected).mark_line(color="black", strokeWidth=1.2).encode(x=x, y=y),
        alt.Chart(pl.concat(curves))
        .mark_line(strokeWidth=1.8)
        .encode(x=x, y=y, color=_colour(scores, colours)),
    ).properties(width=_WIDTH, height=_HEIGHT, title=f"Stated errors of {_LABELS[quantity.name]}")


def further_errors(scores: pl.DataFrame, colours: Mapping[str, str]) -> list[Chart]:
    """Plot errors of psi against psi and of compliance against compliance, if estimated."""
    return [
        chart
        for chart in (
            _dots(scores, colours, ("true_psi_deg", "psi [deg]"), ("psi_error_deg", "deg")),
            _dots(
                scores.filter(pl.col("k_s_n_m").is_not_null()),
                colours,
                ("true_compliance_mm_per_n", "1/k_s [mm/N]"),
                ("compliance_error_pct", "%"),
                logarithmic=True,
            ),
        )
        if chart is not None
    ]


def _dots(
    scores: pl.DataFrame,
    colours: Mapping[str, str],
    true: tuple[str, str],
    error: tuple[str, str],
    *,
    logarithmic: bool = False,
) -> Chart | None:
    """Plot |error| on a logarithmic axis against truth, for at most MOST_DOTS frames."""
    rows = scores.drop_nulls([true[0], error[0]]).select(
        "method", pl.col(true[0]).alias("true"), pl.col(error[0]).abs().alias("error")
    )
    rows = rows.filter(pl.col("error") > 0)
    if rows.is_empty():
        return None
    quantity = true[1].partition(" ")[0]
    x = alt.X("true:Q", title=f"true {true[1]}").scale(
        type="log" if logarithmic else "linear", zero=False
    )
    y = alt.Y("error:Q", title=f"|error| of {quantity} [{error[1]}]").scale(type="log")
    dots = alt.Chart(sample_dots(rows)).mark_circle(size=20, opacity=0.6)
    return alt.layer(dots.encode(x=x, y=y, color=_colour(rows, colours))).properties(
        width=_WIDTH, height=_HEIGHT, title=f"Error of {quantity}"
    )
