"""Estimates as rows of a table: the columns of every predictions file, with their units."""

import csv
import io
import math
from collections.abc import Sequence
from typing import Final

from solver.instrument.errors import cell_text
from solver.instrument.estimate import Estimate
from solver.instrument.quantities import QUANTITIES

# Correlation coefficients of two values of an estimate, by column.
CORRELATIONS: Final = {
    "x_c_force_correlation": ("x_c_m", "force_n"),
    "x_c_y_c_correlation": ("x_c_m", "y_c_m"),
    "contact_world_x_y_correlation": ("contact_world_x_m", "contact_world_y_m"),
}
COLUMNS: Final = (
    "frame_id",
    "outcome",
    "message",
    "assumption",
    *(name for column in QUANTITIES.values() for name in (column.name, column.sigma_name)),
    *CORRELATIONS,
    "chi2",
    "dof",
    "iterations",
    "image_ms",
)

Row = dict[str, str | float | int | None]


def row(frame_id: str, estimate: Estimate, image_ms: float | None) -> Row:
    """Build one frame's row; what the method does not estimate is None, an empty cell.

    A number that is not finite in the column's unit is None, too.
    """
    cells: Row = dict.fromkeys(COLUMNS)
    cells.update(
        frame_id=frame_id,
        outcome=str(estimate.outcome),
        message=cell_text(estimate.message) or estimate.outcome.sentence,
        assumption=None if estimate.assumption is None else str(estimate.assumption),
        chi2=estimate.chi2,
        dof=estimate.dof,
        iterations=estimate.iterations,
        image_ms=image_ms,
    )
    for name, value in estimate.values.items():
        column = QUANTITIES[name]
        cells[column.name] = float(value) / column.unit
        if estimate.covariance is not None:
            cells[column.sigma_name] = estimate.sigma(column.name)
    cells.update({name: estimate.correlation(*pair) for name, pair in CORRELATIONS.items()})
    return {
        name: None if isinstance(cell, float) and not math.isfinite(cell) else cell
        for name, cell in cells.items()
    }


def csv_text(rows: list[Row], columns: Sequence[str] = COLUMNS) -> str:
    """Format the table as CSV, floats in full precision. A message may be of unknown origin."""
    stream = io.StringIO()
    writer = csv.DictWriter(stream, columns, lineterminator="\n")
    writer.writeheader()
    for cells in rows:
        message = cells.get("message")
        safe = {"message": cell_text(message)} if isinstance(message, str) else {}
        writer.writerow({**cells, **safe})
    return stream.getvalue()
