"""The command `outline`: a table of estimates in, a table of the outline out."""

import csv
import io
import math
from pathlib import Path
from typing import Final

import numpy as np

from solver.instrument.csv_table import CsvRow, csv_rows
from solver.instrument.errors import InputError, quoted
from solver.instrument.units import DEGREE, MILLIMETRE
from solver.outline.contacts import Row
from solver.outline.fit import Outline

COLUMNS: Final = ("normal_deg", "x_mm", "y_mm", "sigma_mm", "nearest_contact_mm")
# Largest table of estimates. Chosen: a row has 1 kB; an outline has thousands at most.
_MAX_BYTES: Final = 100_000_000
_TEXTS: Final = ("frame_id", "outcome", "message")


def read_estimates(path: Path) -> list[Row]:
    """Read a CSV that `solve` has written; empty cells are None. Raises InputError."""
    rows = list(csv_rows(path, _MAX_BYTES))
    for name in ("frame_id", "outcome"):
        if rows and name not in rows[0].cells:
            raise InputError(f"{path}: the column {name} is missing")
    return [{name: _cell(f"{path}:{row.line}", name, row) for name in row.cells} for row in rows]


def _cell(where: str, name: str, row: CsvRow) -> float | str | None:
    value = row.cells[name]
    if not value or name in _TEXTS:
        return value or None
    try:
        number = row.number(name)
    except ValueError:  # a non-numeric extra column
        return value
    if not math.isfinite(number):
        raise InputError(f"{where}: {name} is {quoted(value)}, allowed is a finite number")
    return number


def csv_text(outline: Outline) -> str:
    """Format an outline as CSV, a row per normal, floats in full precision."""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(COLUMNS)
    lengths = np.column_stack([outline.points, outline.sigmas, outline.nearest_contact])
    writer.writerows(
        [float(normal / DEGREE), *map(float, row / MILLIMETRE)]
        for normal, row in zip(outline.normals, lengths, strict=True)
    )
    return stream.getvalue()


def summary(outline: Outline) -> str:
    """Describe an outline in a few sentences."""
    mm = MILLIMETRE
    loop = np.vstack([outline.points, outline.points[:1]]) if outline.closed else outline.points
    length = np.linalg.norm(np.diff(loop, axis=0), axis=1).sum()
    low, high = outline.points.min(axis=0) / mm, outline.points.max(axis=0) / mm
    first, last = outline.normals[[0, -1]] / DEGREE
    extent = "closed" if outline.closed else f"open, normals from {first:.0f} to {last:.0f} degrees"
    *shift, turn = outline.correction
    *shift_sigmas, turn_sigma = outline.correction_sigmas
    return (
        f"{outline.used.sum()} contacts, {(~outline.used).sum()} rejected; outline {extent}, "
        f"{length / mm:.4g} mm long, x {low[0]:.3f} to {high[0]:.3f} mm, "
        f"y {low[1]:.3f} to {high[1]:.3f} mm.\n"
        f"Its sigma along the normal: median {np.median(outline.sigmas) / mm:.2g} mm, largest "
        f"{outline.sigmas.max() / mm:.2g} mm. Farthest point from a contact: "
        f"{outline.nearest_contact.max() / mm:.2g} mm; a dent is not visible to the beam.\n"
        f"Correction of the antenna's frame: x {shift[0] / mm:+.3f} +- {shift_sigmas[0] / mm:.3f} "
        f"mm, y {shift[1] / mm:+.3f} +- {shift_sigmas[1] / mm:.3f} mm, turn {turn / DEGREE:+.4f} "
        f"+- {turn_sigma / DEGREE:.4f} degrees."
    )
