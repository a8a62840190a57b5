"""Estimates as rows of a table: the columns of every predictions file, with their units."""

import csv
import io
import itertools
import math
from typing import Final

from solver.instrument.estimate import Estimate
from solver.instrument.units import DEGREE, MILLIMETRE

_POINTS: Final = tuple(itertools.product(("antenna", "world"), "xyz"))
# value in an Estimate -> (column, what one of the column's units is in SI)
COLUMN_OF: Final = {
    "x_c_m": ("x_c_mm", MILLIMETRE),
    "y_c_m": ("y_c_mm", MILLIMETRE),
    "s_c_m": ("s_c_mm", MILLIMETRE),
    "force_n": ("force_n", 1.0),
    "f_n": ("f_n", 1.0),
    "theta_c_rad": ("theta_c_deg", DEGREE),
    "psi_rad": ("psi_deg", DEGREE),
    **{f"contact_{f}_{a}_m": (f"contact_{f}_{a}_mm", MILLIMETRE) for f, a in _POINTS},
    **{f"force_{a}_n": (f"force_{a}_n", 1.0) for a in "xyz"},
    **{f"displacement_{a}_m": (f"displacement_{a}_mm", MILLIMETRE) for a in "yz"},
    "compliance_m_per_n": ("compliance_mm_per_n", MILLIMETRE),
    "stiffness_n_per_m": ("stiffness_n_per_m", 1.0),
    "friction": ("friction", 1.0),
    "onset_angle_rad": ("onset_angle_deg", DEGREE),
    "motor_angle_rad": ("motor_angle_deg", DEGREE),
}


def _sigma_column(column: str) -> str:
    for unit in ("_mm_per_n", "_n_per_m", "_mm", "_deg", "_n"):
        if column.endswith(unit):
            return f"{column.removesuffix(unit)}_sigma{unit}"
    return f"{column}_sigma"


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
    """One frame's row; what the method does not estimate is None, an empty cell.

    A number that is not finite in the column's unit is left out, too.
    """
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
        cells[column] = float(value) / unit
        if estimate.covariance is not None:
            cells[_sigma_column(column)] = estimate.sigma(name) / unit
    return {
        name: None if isinstance(cell, float) and not math.isfinite(cell) else cell
        for name, cell in cells.items()
    }


def csv_text(rows: list[Row]) -> str:
    """The table as CSV, floats in full precision."""
    stream = io.StringIO()
    writer = csv.DictWriter(stream, COLUMNS, lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return stream.getvalue()
