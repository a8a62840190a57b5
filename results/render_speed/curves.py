"""Curves of seconds against error: comparison at equal error, and plots."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import altair as alt
import numpy as np
import polars as pl
import vl_convert as vlc

from solver.instrument.files import write_bytes

# Error of the image, over the beam's peak radiance, at which seconds are compared.
TARGET: Final = 0.005

Record = dict[str, Any]


def at_equal_error(curve: Sequence[Record], target: float = TARGET) -> Record:
    """Compute the seconds at which a curve has the error `target`, by log-log interpolation.

    Beyond its ends the curve is `extrapolated` by the slope of the two points there.
    """
    points = sorted(curve, key=lambda point: float(point["rmse_over_peak"]))
    error = np.log([point["rmse_over_peak"] for point in points])
    seconds = np.log([point["seconds"] for point in points])
    log_target = math.log(target)
    inside = bool(error[0] <= log_target <= error[-1])
    if inside:
        log_seconds = float(np.interp(log_target, error, seconds))
    else:
        end, neighbour = (0, 1) if log_target < error[0] else (-1, -2)
        slope = (seconds[end] - seconds[neighbour]) / (error[end] - error[neighbour])
        log_seconds = float(seconds[end] + slope * (log_target - error[end]))
    return {"seconds": math.exp(log_seconds), "extrapolated": not inside}


def sentence(record: Record, out: Path) -> str:
    """Summarise a record in one sentence."""
    extrapolated = any(point["extrapolated"] for point in record["at_target"].values())
    return (
        f"at an error of {100 * TARGET:g} % of the beam's peak "
        f"{record['speedup_at_equal_rmse']:.3g} times as fast as plain Mitsuba"
        f"{', extrapolated' if extrapolated else ''}; scene's noise targets: "
        f"{record['frames_per_s']:.3g} frames/s, error "
        f"{100 * record['rmse_over_peak']:.2g} %, {record['seconds_over_rays']:.2g} times as long "
        f"as its rays alone; {out / 'render_speed.png'}"
    )


def write(record: Record, out: Path, names: Sequence[str]) -> None:
    """Write a record's curves of the renderers `names` as render_speed.csv and .png."""
    table = pl.DataFrame(
        [point for curve in record["curves"].values() for point in curve],
        infer_schema_length=None,
    )
    out.mkdir(parents=True, exist_ok=True)
    table.write_csv(out / "render_speed.csv")
    plotted = table.with_columns(percent=100 * pl.col("rmse_over_peak"))
    x = alt.X("seconds:Q", title="seconds per frame, end to end").scale(type="log", nice=False)
    y = alt.Y("percent:Q", title="RMSE on the beam [% of its peak]").scale(type="log", nice=False)
    colour = alt.Color("renderer:N", title=None, sort=list(names)).legend(orient="bottom")
    target = alt.Chart(pl.DataFrame({"percent": [100 * TARGET]})).mark_rule(strokeDash=[4, 3])
    base = alt.Chart(plotted)
    chart = alt.layer(
        target.encode(y=y),
        base.mark_line().encode(x=x, y=y, color=colour, order="rmse_over_peak:Q"),
        base.mark_circle(size=70, opacity=1).encode(x=x, y=y, color=colour),
    )
    title = f"{record['scene']}: ours {record['speedup_at_equal_rmse']:.0f} times as fast"
    chart = chart.properties(width=430, height=300, title=title)
    write_bytes(out / "render_speed.png", vlc.vegalite_to_png(chart.to_json(), scale=2))
