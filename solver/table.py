"""Estimates as rows of a table: the columns of every predictions file, with their units."""

import csv
import io
from typing import Final

from solver.instrument.estimate import Estimate
from solver.instrument.units import DEGREE, MILLIMETRE

# value in an Estimate -> (column, what one of the column's units is in SI)
COLUMN_OF: Final = {
    "x_c_m": ("x_c_mm", MILLIMETRE),
    "y_c_m": ("y_c_mm", MILLIMETRE),
    "s_c_m": ("s_c_mm", MILLIMETRE),
    "force_n": ("force_n", 1.0),
    "theta_c_rad": ("theta_c_deg", DEGREE),
}


def _sigma_column(column: str) -> str:
    stem, _, unit = column.rpartition("_")
    return f"{stem}_sigma_{unit}"


COLUMNS: Final = (
    "frame_id",
    "outcome",
    "message",
    *(name for column, _ in COLUMN_OF.values() for name in (column, _sigma_column(column))),
    "chi2",
    "dof",
    "iterations",
    "image_ms",
)

Row = dict[str, str | float | int | None]


def row(frame_id: str, estimate: Estimate, image_ms: float | None) -> Row:
    """One frame's row; what the method does not estimate is None, an empty cell."""
    cells: Row = dict.fromkeys(COLUMNS)
    cells.update(
        frame_id=frame_id,
        outcome=str(estimate.outcome),
        message=estimate.message or estimate.outcome.sentence,
        chi2=estimate.chi2,
        dof=estimate.dof,
        iterations=estimate.iterations,
        image_ms=image_ms,
    )
    for name, value in estimate.values.items():
        column, unit = COLUMN_OF[name]
        cells[column] = value / unit
        if estimate.covariance is not None:
            cells[_sigma_column(column)] = estimate.sigma(name) / unit
    return cells


def csv_text(rows: list[Row]) -> str:
    """The table as CSV, floats in full precision."""
    stream = io.StringIO()
    writer = csv.DictWriter(stream, COLUMNS, lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return stream.getvalue()
