"""The paper's Figs. 6, 8, 9, 11 and 13 as errors: a chart per method, all on one scale."""

from collections.abc import Mapping, Sequence
from typing import Final, NamedTuple

import numpy as np
import polars as pl
from markupsafe import Markup

from solver.instrument.arrays import Floats
from vbaa_bench.report.chart import Axis, Margins, Plot, log_axis, signed_axis
from vbaa_bench.report.numbers import short, signed
from vbaa_bench.report.speed_chart import CLAIM_PCT
from vbaa_bench.scoring.statistics import MEDIAN, P05, P95
from vbaa_bench.scoring.strata import Stratum

_SIZE: Final = (300, 190)
# Chosen: dots of a chart overlap beyond this, and each takes 100 bytes of the page.
MAX_DOTS: Final = 150
_BINS: Final = 9


class Figure(NamedTuple):
    """A figure: error `y` [y_unit] over the condition `x`; `claim` is the paper's result.

    `band` is the paper's figure for the error, drawn as two lines; None if it states none.
    """

    title: str
    claim: str
    x: str
    x_label: str
    logarithmic: bool
    y: str
    y_label: str
    y_unit: str
    band: float | None = None


class Panels(NamedTuple):
    """A drawn figure: charts by method, and what its marks mean."""

    figure: Figure
    charts: Sequence[tuple[str, Markup]]
    thinned: bool


def figures(scores: pl.DataFrame) -> list[Figure]:
    """Choose the figures for which the scores have data."""
    collection = "factor.x_c_over_L" in scores.columns
    springs = scores["k_s_over_k_beam"].is_not_null().any()
    inclined = scores["true_psi_deg"].drop_nulls().cast(pl.Float64).round(2).n_unique() > 1
    sensor = "moment_sensor" in scores["method"].unique()
    covered = scores["availability_asked"].drop_nulls().n_unique() > 1
    x_c = "x_c_share" if collection else "true_x_c_mm"
    place = (x_c, f"contact distance [{'% of L' if collection else 'mm'}]", False)
    if collection or covered:
        distance = force = ""
    elif inclined:
        distance, force = " (Fig. 9 (a))" if sensor else "", ""
    else:
        number = 11 if springs else 8
        distance, force = f" (Fig. {number} (a))", f" (Fig. {number} (b))"
    chosen = [
        Figure(
            f"Contact distance{distance}",
            "The paper reaches ±2 % in its best case (section VI-A).",
            *place,
            "x_c_error_pct_L",
            "error of x_c",
            "% of L",
            CLAIM_PCT,
        ),
        Figure(
            f"Contact force{force}",
            "The paper calls the agreement with theory fairly good and states no number.",
            *place,
            "force_error_pct",
            "error of force",
            "%",
        ),
    ]
    if inclined:
        chosen.append(
            Figure(
                f"Inclination of the deformation plane ({'Fig. 9 (b)' if sensor else 'Fig. 6'})",
                "The paper's estimated direction almost coincides with the object's normal."
                if sensor
                else "The paper simulates that psi has one solution, and states no error.",
                "true_psi_deg",
                "true psi [deg]",
                False,
                "psi_error_deg",
                "error of psi",
                "deg",
            )
        )
    if springs:
        chosen.append(
            Figure(
                "Compliance of springs (Fig. 11 (c))",
                "The paper finds (31) unreliable for contacts near the base, and needs pushing "
                "angles of 5 deg or more.",
                "k_s_over_k_beam",
                "stiffness over the beam's, k_s / k_beam",
                True,
                "compliance_error_pct",
                "error of 1/k_s",
                "%",
            )
        )
    if covered:
        chosen.append(
            Figure(
                "Occlusion (Fig. 13)",
                "The paper keeps its accuracy with more than 65 % of the beam hidden, best "
                "with the tip in view.",
                "availability_asked",
                "availability ratio AR (eq. 32)",
                False,
                "x_c_error_pct_L",
                "error of x_c",
                "% of L",
                CLAIM_PCT,
            )
        )
    return [one for one in chosen if scores[one.y].is_not_null().any()]


def panels(
    scores: pl.DataFrame,
    figure: Figure,
    methods: Sequence[str],
    classes: Mapping[str, str],
    strata: Sequence[Stratum],
) -> Panels:
    """Draw a figure: for each method dots of at most MAX_DOTS frames, and a line of medians.

    Medians and the band of the middle 90 % are computed from all frames, for every stratum
    separately; a line has the attribute `data-view`, the number of its stratum, and a dot
    `data-in`, those of all strata that contain it.
    """
    table = _table(scores, figure, strata)
    table = table.with_columns(_bin(table["x"], figure))
    errors = table["y"].to_numpy()
    medians = table.group_by("method").agg(MEDIAN.expression(pl.col("y").abs()))["y"].to_list()
    y = signed_axis(f"{figure.y_label} [{figure.y_unit}]", errors, min(medians))
    x = _x_axis(table["x"].to_numpy(), figure)
    charts = []
    for name in methods:
        rows = table.filter(pl.col("method") == name)
        if rows.height:
            charts.append((name, _panel(rows, figure, name, classes[name], (x, y), len(strata))))
    thinned = table.group_by("method").len()["len"].max()
    return Panels(figure, charts, isinstance(thinned, int) and thinned > MAX_DOTS)


def _table(scores: pl.DataFrame, figure: Figure, strata: Sequence[Stratum]) -> pl.DataFrame:
    """Select the frames with an error: method, x, y, and a column `in_<n>` for each stratum."""
    if figure.x == "x_c_share":
        scores = scores.with_columns(x_c_share=100 * pl.col("factor.x_c_over_L"))
    return scores.select(
        "method",
        "frame_id",
        "deflection_pct",
        pl.col(figure.x).cast(pl.Float64).alias("x"),
        pl.col(figure.y).cast(pl.Float64).alias("y"),
        *(one.contains.fill_null(value=False).alias(f"in_{n}") for n, one in enumerate(strata)),
    ).drop_nulls(["x", "y"])


def _bin(x: pl.Series, figure: Figure) -> pl.Series:
    """Number the classes of x: its values if there are few, else classes of equal width."""
    values = np.log(x.to_numpy()) if figure.logarithmic else x.to_numpy()
    rounded = np.round(values, 3)
    if len(np.unique(rounded)) <= _BINS:
        return pl.Series("bin", np.unique(rounded, return_inverse=True)[1])
    low, high = values.min(), values.max()
    return pl.Series(
        "bin", np.minimum((values - low) / (high - low) * _BINS, _BINS - 1).astype(int)
    )


def _x_axis(values: Floats, figure: Figure) -> Axis:
    if figure.logarithmic:
        return log_axis(figure.x_label, values, 1.3)
    low, high = float(values.min()), float(values.max())
    margin = 0.05 * (high - low) or 1.0
    return Axis(figure.x_label, low - margin, high + margin)


def _panel(
    rows: pl.DataFrame, figure: Figure, name: str, style: str, axes: tuple[Axis, Axis], views: int
) -> Markup:
    middle = MEDIAN.of(rows["y"].abs().to_numpy())
    description = (
        f"{name}: {figure.y_label} over {figure.x_label}, median {short(middle)} {figure.y_unit}"
    )
    plot = Plot(*axes, _SIZE, description, Margins(left=58))
    plot.across(0.0, class_="zero")
    for sign in (-1, 1) if figure.band is not None and figure.band < axes[1].high else ():
        plot.across(
            sign * (figure.band or 0.0), class_="claim", data_t=f"paper: ±{figure.band:g} %"
        )
    members = rows.select(pl.col(r"^in_\d+$")).to_numpy()
    for view in range(views):
        _medians(plot, rows.filter(pl.col(f"in_{view}")), style, view)
    shown = np.arange(rows.height)
    if rows.height > MAX_DOTS:
        shown = np.sort(np.random.default_rng(0).permutation(rows.height)[:MAX_DOTS])
    for row, inside in zip(rows[shown].iter_rows(named=True), members[shown], strict=True):
        u, v = plot.place(row["x"], row["y"])
        tip = (
            f"{signed(row['y'])} {figure.y_unit}; {figure.x_label}: {short(row['x'], 3)}; "
            f"deflection {short(row['deflection_pct'])} %"
        )
        numbers = " ".join(map(str, np.flatnonzero(inside)))
        plot.add(
            "circle", cx=f"{u:.0f}", cy=f"{v:.1f}", r=2, class_=style, data_in=numbers, data_t=tip
        )
    return plot.svg()


def _medians(plot: Plot, rows: pl.DataFrame, style: str, view: int) -> None:
    """Draw the medians of the classes of x, and the band between their 5 % and 95 % quantiles."""
    y = pl.col("y")
    line = (
        rows.group_by("bin")
        .agg(
            MEDIAN.expression(pl.col("x")),
            middle=MEDIAN.expression(y),
            low=P05.expression(y),
            high=P95.expression(y),
        )
        .sort("x")
    )
    if line.height:
        x, middle, low, high = (line[name].to_numpy() for name in ("x", "middle", "low", "high"))
        hidden = "hidden" if view else None
        marks = {"data_view": view, "hidden": hidden}
        plot.band(x, low, high, class_=f"band {style}", **marks)
        plot.line(x, middle, class_=f"curve {style}", **marks)
