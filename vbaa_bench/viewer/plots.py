"""Entities over time and in the plot of errors: values, ellipses, and a table."""

import math
from collections.abc import Mapping
from typing import Any, Final, NamedTuple

import numpy as np

from vbaa_bench.report import palette
from vbaa_bench.report.numbers import short
from vbaa_bench.viewer.ellipses import AXES, HALF, TICKS, ellipse_plot
from vbaa_bench.viewer.frames import ViewedDataset, ViewedFrame
from vbaa_bench.viewer.log import Log, present, rgb

# Name of the truth beside those of the methods.
_TRUE: Final = "true"
_FAINT: Final = "#8a9199"
_HEAD: Final = "| method | x_c, mm | +- | force, mN | +- | outcome |\n|---|---:|---:|---:|---:|---|"


class Series(NamedTuple):
    """A quantity over time: its column, heading, factor for display, and whether it is an error."""

    name: str
    column: str
    heading: str
    factor: float = 1.0
    is_error: bool = False


_SERIES: Final = (
    Series("x_c", "x_c_mm", "contact distance x_c [mm]"),
    Series("x_c_error", "x_c_mm", "error of x_c [mm]", is_error=True),
    Series("force", "force_n", "force [mN]", 1e3),
    Series("psi", "psi_deg", "inclination psi [deg]"),
)


def estimated_series(data: ViewedDataset) -> list[Series]:
    """List the quantities that a method estimates; without predictions, those of the truth."""
    tables = data.predictions.values()
    return [
        series
        for series in _SERIES
        if any(table[series.column].count() for table in tables) or not (tables or series.is_error)
    ]


class Plots:
    """Writer of values over time, of errors with their ellipses, and of the table of a frame."""

    def __init__(self, log: Log, data: ViewedDataset, colours: dict[str, str]) -> None:
        self._log, self._colours = log, colours
        self._series = estimated_series(data)
        self._methods = {
            series.name: [
                name for name, table in data.predictions.items() if table[series.column].count()
            ]
            for series in self._series
        }
        self._plot = ellipse_plot(data.predictions)

    def fixed(self) -> None:
        """Write the styles of lines and the axes of the plot of errors."""
        for series in self._series:
            if not series.is_error:
                self._style(f"{series.name}/{_TRUE}", palette.TRUTH, 3.0)
            for method in self._methods[series.name]:
                self._style(f"{series.name}/{method}", self._colours[method], 1.5)
        log, rr = self._log, self._log.rr
        log.lines("errors/axes", [*AXES, *TICKS], _FAINT, 0.7, static=True)
        labels = [
            f"x_c + {HALF * self._plot.x_c_mm:g} mm",
            f"force + {HALF * self._plot.force_pct:g} %",
        ]
        ends = rr.Points2D(
            [(HALF - 0.6, 0.8), (1.4, 0.3 - HALF)],
            labels=labels,
            colors=rgb(_FAINT),
            radii=rr.Radius.ui_points(0.0),
            show_labels=True,
        )
        log.write("errors/ends", ends, static=True)

    def frame(self, frame: ViewedFrame) -> None:
        """Write the values of a frame."""
        for series in self._series:
            true = frame.row[series.column]
            if not series.is_error:
                self._value(f"{series.name}/{_TRUE}", true, series.factor)
            for method in self._methods[series.name]:
                value = frame.estimates.get(method, {}).get(series.column)
                if series.is_error:
                    value = None if value is None or true is None else value - true
                self._value(f"{series.name}/{method}", value, series.factor)
        for method, colour in self._colours.items():
            row = frame.estimates.get(method)
            placed = None if row is None else self._plot.place(row, frame.row)
            point = None if placed is None else placed.point
            outline = None if placed is None else placed.ellipse
            self._log.points(f"errors/{method}", present(point), colour, 4.0, method)
            self._log.lines(f"errors/{method}/ellipse", present(outline), colour)
        document = self._log.rr.TextDocument(_table(frame), media_type="text/markdown")
        self._log.write("table", document)

    def _style(self, entity: str, colour: str, width: float) -> None:
        rr, name = self._log.rr, entity.rpartition("/")[2]
        line = rr.SeriesLines(names=name, colors=rgb(colour), widths=width)
        self._log.write(entity, line, static=True)

    def _value(self, entity: str, value: float | None, factor: float) -> None:
        """Write a value; a missing one interrupts the line."""
        number = math.nan if value is None else factor * value
        self._log.write(entity, self._log.rr.Scalars(np.float64(number)))


def _table(frame: ViewedFrame) -> str:
    """Tabulate the truth and all estimates of a frame, as Markdown."""
    row = frame.row
    lines = [f"**{frame.title}**", "", _HEAD]
    lines.append(f"| true | {_cell(row['x_c_mm'])} | | {_cell(row['force_n'], 1e3)} | | |")
    lines += [_line(method, estimate) for method, estimate in frame.estimates.items()]
    lines += ["", f"frame {frame.row['frame_id']}, push {frame.row['push_id']}"]
    return "\n".join(lines)


def _line(method: str, row: Mapping[str, Any]) -> str:
    cells = (
        method,
        _cell(row["x_c_mm"]),
        _cell(row["x_c_sigma_mm"], digits=2),
        _cell(row["force_n"], 1e3),
        _cell(row["force_sigma_n"], 1e3, 2),
        row["outcome"],
    )
    return f"| {' | '.join(cells)} |"


def _cell(value: float | None, factor: float = 1.0, digits: int = 5) -> str:
    return "–" if value is None else short(factor * value, digits)
