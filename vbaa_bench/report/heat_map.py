"""Heat maps of the error over contact distance and deflection, as tables with coloured cells."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Final

import numpy as np
import polars as pl

from vbaa_bench.report.numbers import short
from vbaa_bench.scoring.statistics import SUMMARY

# Chosen: six columns of 44 px fit a telephone.
_COLUMNS: Final = 6
_MAX_ROWS: Final = 6
# Cells of fewer frames are gray: an RMSE of four errors is uncertain by 35 %. From the requirement.
_FEW: Final = 5
# Upper ends of the classes of colour: RMSE over limit, and without limits RMSE in % of L.
_RATIO_ENDS: Final = (1.2, 1.5, 2.0, 4.0, 10.0, 100.0)
_ERROR_ENDS: Final = (0.01, 0.03, 0.1, 0.3, 1.0, 3.0)


@dataclass(frozen=True)
class Cell:
    """A cell: its number as text, its class of colour (None without frames), and a tooltip.

    `frames` is the number of frames with an estimate; `few` is whether they are too few to judge.
    """

    text: str
    level: int | None
    tip: str
    frames: int = 0

    @property
    def few(self) -> bool:
        """Whether fewer frames are in the cell than a root mean square needs."""
        return self.frames < _FEW


@dataclass(frozen=True)
class HeatMap:
    """The table of one method; `rows` are label and cells."""

    method: str
    rows: Sequence[tuple[str, Sequence[Cell]]]


@dataclass(frozen=True)
class Bins:
    """Classes of contact distance and of deflection that all heat maps share.

    `relative` is whether cells contain RMSE over limit instead of the RMSE in % of L.
    """

    columns: Sequence[str]
    rows: Sequence[str]
    relative: bool

    def legend(self, maps: Sequence[HeatMap]) -> list[tuple[int, str]]:
        """List the classes of colour that occur in maps, with their ranges as text."""
        ends = _RATIO_ENDS if self.relative else _ERROR_ENDS
        unit = "" if self.relative else " %"
        texts = [f"≤ {short(end)}{unit}" for end in ends]
        texts.append(f"> {short(ends[-1])}{unit}")
        cells = [cell for one in maps for _, row in one.rows for cell in row if not cell.few]
        drawn = sorted({cell.level for cell in cells if cell.level is not None})
        return [(level, texts[level]) for level in drawn]


def with_bins(scores: pl.DataFrame) -> tuple[pl.DataFrame, Bins]:
    """Add the columns `x_bin` and `y_bin` to scores, and describe the bins.

    Each contact distance at rest and each deflection is a class; of more than six values there
    are six classes of x_c, or five of the deflection, of equal width.
    """
    frames = scores.filter(~pl.col("free"))
    relative = scores["x_c_limit_pct_L"].is_not_null().any()
    if frames.is_empty():
        nothing = pl.lit(None, pl.Int64)
        return scores.with_columns(x_bin=nothing, y_bin=nothing), Bins([], [], relative)
    columns, x_bin = _x_bins(frames)
    deflection = "deflection_pct"
    rows, y_bin = _values(frames, deflection, _MAX_ROWS) or _equal(
        frames[deflection], pl.col(deflection), _MAX_ROWS - 1
    )
    rows = [f"{row} %" for row in rows]
    binned = scores.with_columns(x_bin=x_bin.cast(pl.Int64), y_bin=y_bin.cast(pl.Int64))
    return binned, Bins(columns, rows, bool(relative))


def _x_bins(frames: pl.DataFrame) -> tuple[list[str], pl.Expr]:
    """Choose the classes of contact distance: at rest if it has few values, else of equal width."""
    share = "factor.x_c_over_L"
    if share in frames.columns:
        return _equal(100 * frames[share], 100 * pl.col(share), _COLUMNS)
    return _values(frames, "contact_distance_at_rest_mm", _COLUMNS) or _equal(
        frames["true_x_c_mm"], pl.col("true_x_c_mm"), _COLUMNS
    )


def _values(frames: pl.DataFrame, column: str, most: int) -> tuple[list[str], pl.Expr] | None:
    """Make a class of each value, rounded to two digits; None if there are too many."""
    values = frames[column].cast(pl.Float64).round_sig_figs(2).unique().sort()
    if len(values) > most or values.null_count():
        return None
    order = {value: number for number, value in enumerate(values)}
    rounded = pl.col(column).cast(pl.Float64).round_sig_figs(2)
    return [short(value) for value in values], rounded.replace_strict(order, default=None)


def _equal(values: pl.Series, column: pl.Expr, count: int) -> tuple[list[str], pl.Expr]:
    low, high = np.min(values.to_numpy()), np.max(values.to_numpy())
    width = (high - low) / count or 1.0
    edges = low + width * np.arange(count + 1)
    labels = [
        f"{edge:.0f}–{upper:.0f}" if width >= 1 else f"{short(edge)}–{short(upper)}"
        for edge, upper in pairwise(edges.tolist())
    ]
    return labels, ((column - low) / width).floor().clip(0, count - 1)


def heat_maps(rows: pl.DataFrame, bins: Bins, methods: Sequence[str]) -> list[HeatMap]:
    """Make the heat map of every method that estimates x_c, from scores with bins."""
    cells = (
        rows.drop_nulls(["x_bin", "y_bin"])
        .group_by("method", "y_bin", "x_bin")
        .agg(
            frames=pl.len(),
            answered=pl.col("x_c_error_pct_L").count(),
            rmse=SUMMARY["x_c_rmse_pct_L"].expression,
            ratio=SUMMARY["x_c_rmse_over_limit"].expression,
        )
    )
    found = {
        (record["method"], record["y_bin"], record["x_bin"]): record for record in cells.to_dicts()
    }
    answering = set(rows.drop_nulls("x_c_error_pct_L")["method"])
    return [
        HeatMap(
            name,
            [
                (label, [_cell(found.get((name, y, x)), bins) for x in range(len(bins.columns))])
                for y, label in enumerate(bins.rows)
            ],
        )
        for name in methods
        if name in answering
    ]


def _cell(record: dict[str, Any] | None, bins: Bins) -> Cell:
    if record is None:
        return Cell("", None, "no frame")
    value = record["ratio"] if bins.relative else record["rmse"]
    if value is None:
        return Cell("–", None, f"no estimate in {record['frames']} frames")
    level = int(np.searchsorted(_RATIO_ENDS if bins.relative else _ERROR_ENDS, value))
    tip = f"RMSE {short(record['rmse'], 3)} % of L"
    if bins.relative:
        tip += f", {short(value, 3)} times the limit"
    tip += f"; {record['answered']} of {record['frames']} frames"
    return Cell(short(value), level, tip, record["answered"])
