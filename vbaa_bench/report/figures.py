"""Charts of the report."""

from collections.abc import Mapping
from typing import Any

import altair as alt
import numpy as np
import polars as pl

from vbaa_bench.report.labels import spread

Summary = dict[str, Any]
Chart = alt.LayerChart | alt.FacetChart

_PUSH = alt.Color("push:N", title="pushed to", sort=None).legend(orient="bottom")
_WIDTH, _HEIGHT = 430, 300
# Distance between the centres of labels, for letters 12 px high.
LABEL_GAP_PX = 16
MAX_PUSHES, DEFLECTION_CLASSES = 12, 6
# Chosen: a chart of this many dots takes 0.36 MB of the page; more of them overlap.
MAX_DOTS = 1000


def sample_dots(rows: pl.DataFrame) -> pl.DataFrame:
    """Reduce rows to a random sample of MAX_DOTS, always the same, in their order."""
    if rows.height <= MAX_DOTS:
        return rows
    return rows[np.sort(np.random.default_rng(0).permutation(rows.height)[:MAX_DOTS])]


def group_pushes(scores: pl.DataFrame) -> pl.DataFrame:
    """Relabel pushes by equal classes of deflection if there are more than MAX_PUSHES."""
    if scores["push"].n_unique() <= MAX_PUSHES:
        return scores
    width = float(np.ptp(scores["deflection_pct"].to_numpy())) / DEFLECTION_CLASSES or 1.0
    index = (pl.col("deflection_pct") / width).floor()
    label = pl.format("{} – {} %", (index * width).round(1), ((index + 1) * width).round(1))
    return scores.with_columns(push=label)


def is_fig8(scores: pl.DataFrame) -> bool:
    """Return whether scores are of one rigid, upright object at few pushes, as in Fig. 8."""
    one_object = scores["normal_deg"].n_unique() == 1 and scores["k_s_n_m"].is_null().all()
    upright = one_object and scores["normal_deg"][0] == 0
    all_contacts = scores["true_x_c_mm"].is_not_null().all()
    return bool(upright and all_contacts and scores["push"].n_unique() <= MAX_PUSHES)


def speed_against_error(summary: Summary, colours: Mapping[str, str]) -> Chart:
    """Plot the median error of x_c against the time per frame, with 95 % bootstrap intervals.

    `colours` maps each method to its CSS colour. Labels are in a column beside the plot.
    """
    rows = []
    for name, values in summary["methods"].items():
        time, error = values["ms_per_frame_median"], values["x_c_median_abs_pct_L"]
        if not time or not error:  # predictions of a user may lack times; exact ones have error 0
            continue
        times = values["ms_per_frame_median_95"] or [time, time]
        errors = values["x_c_median_abs_pct_L_95"] or [error, error]
        label = f"{name}: {error:.2g} % in {time:.2g} ms"
        rows.append(
            {
                "method": name,
                "label": label,
                "ms": time,
                "ms_low": times[0],
                "ms_high": times[1],
                "error": error,
                "error_low": errors[0],
                "error_high": errors[1],
            }
        )
    span_x = _decades([r["ms"] for r in rows], 3)
    span_y = _decades([r["error"] for r in rows], 3)
    per_px = np.log(span_y[1] / span_y[0]) / _HEIGHT
    label_positions = np.exp(spread(np.log([r["error"] for r in rows]), LABEL_GAP_PX * per_px))
    for row, position in zip(rows, label_positions, strict=True):
        row["label_at"] = float(position)
        row["label_from"] = span_x[1]
    texts = ("method", "label")
    numbers = ("ms", "ms_low", "ms_high", "label_from", "error", "error_low", "error_high")
    schema: dict[str, Any] = dict.fromkeys(texts, pl.String)
    schema |= dict.fromkeys((*numbers, "label_at"), pl.Float64)
    base = alt.Chart(pl.DataFrame(rows, schema=schema))
    x = alt.X("ms:Q", title="time per frame, image to estimate [ms]").scale(
        type="log", domain=span_x, nice=False
    )
    y = alt.Y("error:Q", title="median |error| of contact distance [% of L]").scale(
        type="log", domain=span_y, nice=False
    )
    colour = alt.Color("method:N", legend=None).scale(
        domain=list(colours), range=list(colours.values())
    )
    return alt.layer(
        base.mark_rule(strokeWidth=1, opacity=0.35).encode(
            x=x, y=y, x2="label_from:Q", y2="label_at:Q", color=colour
        ),
        base.mark_rule(strokeWidth=2).encode(x=x, y="error_low:Q", y2="error_high:Q", color=colour),
        base.mark_rule(strokeWidth=2).encode(x="ms_low:Q", x2="ms_high:Q", y=y, color=colour),
        base.mark_circle(size=120, opacity=1).encode(x=x, y=y, color=colour),
        base.mark_text(align="left", dx=5, baseline="middle", fontSize=12).encode(
            x="label_from:Q", y="label_at:Q", text="label:N", color=colour
        ),
    ).properties(width=_WIDTH, height=_HEIGHT, title="Speed against error")


def fig8_contact_distance(scores: pl.DataFrame, method: str) -> Chart:
    """Plot Fig. 8 (a): estimated against true contact distance; the line is the truth."""
    rows = sample_dots(_answered(scores, method))
    line = alt.Chart(rows).mark_line(color="black", strokeWidth=1)
    dots = alt.Chart(rows).mark_point(size=22)
    x = alt.X("true_x_c_mm:Q", title="contact distance [mm]").scale(zero=False)
    return alt.layer(
        line.encode(x=x, y=alt.Y("true_x_c_mm:Q", title="estimated contact distance [mm]")),
        dots.encode(x=x, y="x_c_mm:Q", color=_PUSH),
    ).properties(width=_WIDTH, height=300, title=f"Fig. 8 (a), {method}")


def fig8_force(scores: pl.DataFrame, method: str, length_mm: float, rigidity_n_mm2: float) -> Chart:
    """Plot Fig. 8 (b): contact force; lines are theory, exact (solid) and linear (dashed)."""
    rows = sample_dots(_answered(scores, method))
    pushes = scores.sort("deflection_pct").group_by("push", maintain_order=True)
    theory = pl.concat(
        _linear_theory(*push, length_mm=length_mm, rigidity_n_mm2=rigidity_n_mm2)
        for push in pushes.agg(pl.col("deflection_pct", "pushing_angle_deg").first()).iter_rows()
    )
    force = theory["force_n"].to_numpy()
    span = [float(force.min()) / 2, float(force.max()) * 2]
    x = alt.X("true_x_c_mm:Q", title="contact distance [mm]").scale(zero=False)
    y = alt.Y("force_n:Q", title="contact force [N]").scale(
        type="log", nice=False, domain=span, clamp=False
    )
    exact = rows.sort("true_x_c_mm").unique(["push", "true_x_c_mm"], maintain_order=True)
    return alt.layer(
        alt.Chart(theory)
        .mark_line(strokeDash=[4, 3], strokeWidth=1, opacity=0.8)
        .encode(x=x, y=y, color=_PUSH),
        alt.Chart(exact)
        .mark_line(strokeWidth=1.2)
        .encode(x=x, y=alt.Y("true_force_n:Q"), color=_PUSH),
        # Estimates beyond the axis, which a mean of pairs can give, are clipped.
        alt.Chart(rows.filter(pl.col("force_n") > 0))
        .mark_point(size=22, clip=True)
        .encode(x=x, y="force_n:Q", color=_PUSH),
    ).properties(width=_WIDTH, height=300, title=f"Fig. 8 (b), {method}")


def _linear_theory(
    push: str,
    deflection_pct: float,
    pushing_angle_deg: float,
    *,
    length_mm: float,
    rigidity_n_mm2: float,
) -> pl.DataFrame:
    """Compute force against contact distance, eqs. (9), (10), for a tip deflection or an angle."""
    x_c = np.linspace(0.2, 0.97, 200) * length_mm
    if push.endswith("%"):  # (10) at the tip: y_tip = f x_c^2 (3 L - x_c) / (6 EI)
        tip = deflection_pct / 100 * length_mm
        force = 6 * rigidity_n_mm2 * tip / (x_c**2 * (3 * length_mm - x_c))
    else:  # (9) at the contact, y_c = x_c tan(dtheta)
        force = 3 * rigidity_n_mm2 * np.tan(np.radians(pushing_angle_deg)) / x_c**2
    return pl.DataFrame({"true_x_c_mm": x_c, "force_n": force, "push": [push] * len(x_c)})


def error_against_distance(scores: pl.DataFrame, method: str) -> Chart:
    """Plot the signed error of the contact distance: a dot per frame, a line for the mean."""
    rows = _answered(scores, method).with_columns(place=(pl.col("true_x_c_mm") / 10).round())
    x = alt.X("true_x_c_mm:Q", title="contact distance [mm]").scale(zero=False)
    error = "x_c_error_pct_L"
    mean = rows.group_by("push", "place").agg(pl.col("true_x_c_mm").mean(), pl.col(error).mean())
    return alt.layer(
        alt.Chart(pl.DataFrame({"zero": [0.0]})).mark_rule(color="gray").encode(y="zero:Q"),
        alt.Chart(sample_dots(rows))
        .mark_circle(size=18, opacity=0.5)
        .encode(
            x=x,
            y=alt.Y(f"{error}:Q", title="error of contact distance [% of L]"),
            color=_PUSH,
        ),
        alt.Chart(mean.sort("push", "place")).mark_line().encode(x=x, y=f"{error}:Q", color=_PUSH),
    ).properties(width=_WIDTH, height=240, title=method)


def _answered(scores: pl.DataFrame, method: str) -> pl.DataFrame:
    columns = ["push", "deflection_pct", "pushing_angle_deg", "true_x_c_mm", "true_force_n"]
    return (
        scores.filter((pl.col("method") == method) & ~pl.col("failed"))
        .select(*columns, "x_c_mm", "x_c_error_pct_L", "force_n")
        .sort("pushing_angle_deg" if scores["push"].str.ends_with("°").all() else "deflection_pct")
    )


def _decades(values: list[float], headroom: float) -> list[float]:
    """Choose the range of a logarithmic axis; `headroom` is the factor above the largest value."""
    if not values:
        return [0.1, 10.0]
    return [min(values) / 3, max(values) * headroom]
