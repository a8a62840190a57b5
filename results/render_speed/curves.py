"""Curves of seconds against error: comparison at equal error, and plots."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
import polars as pl

from solver.instrument.files import write_bytes
from vbaa_bench.report.chart import Margins, Plot, chart_png, log_axis

# Error of the image, over the beam's peak radiance, at which seconds are compared.
TARGET: Final = 0.005
_SIZE: Final = (520, 360)
_COLOURS: Final = ("#0b57d0", "#b3261e", "#9a5b00")

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
    write_bytes(out / "render_speed.png", _png(record, names))


def _png(record: Record, names: Sequence[str]) -> bytes:
    """Draw the curves, each with its name at its last point."""
    curves = {
        name: (
            np.array([point["seconds"] for point in record["curves"][name]]),
            100 * np.array([point["rmse_over_peak"] for point in record["curves"][name]]),
        )
        for name in names
    }
    seconds, percents = (np.concatenate(values) for values in zip(*curves.values(), strict=True))
    plot = Plot(
        log_axis("seconds per frame, end to end", seconds, 1.15),
        log_axis("RMSE on the beam [% of its peak]", np.append(percents, 100 * TARGET), 1.15),
        _SIZE,
        "Error of the image against seconds per frame",
        Margins(top=30, right=90),
    )
    title = f"{record['scene']}: ours {record['speedup_at_equal_rmse']:.0f} times as fast"
    plot.text(_SIZE[0] / 2, 18, title, class_="name")
    plot.across(100 * TARGET, class_="limit")
    for name, (x, y) in curves.items():
        plot.line(x, y, class_=f"curve {name}")
        for at in zip(x, y, strict=True):
            plot.marker(*at, "circle", 4, class_=name)
        u, v = plot.place(x[-1], y[-1])
        plot.text(float(u) + 8, float(v) + 4, name, class_=f"label {name}")
    return chart_png(plot.svg(), dict(zip(names, _COLOURS, strict=True)))
