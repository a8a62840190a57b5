"""The command `outline`: estimates from many poses in, the outline of the object out."""

import math
from pathlib import Path
from typing import Annotated, Final

import numpy as np
import typer

from solver.instrument.csv_table import CsvRow, csv_rows
from solver.instrument.errors import InputError, quoted
from solver.instrument.metadata import read_frames
from solver.instrument.observation import open_observations, rig_file
from solver.instrument.rig_json import read_rig
from solver.instrument.units import DEGREE, MILLIMETRE
from solver.lab.table import csv_text
from solver.lab.writing import prepare_output_path, write
from solver.outline.contacts import Row, contacts_of
from solver.outline.fit import Outline, fit_outline

COLUMNS: Final = ("normal_deg", "x_mm", "y_mm", "sigma_mm", "nearest_contact_mm")
# Largest table of estimates. Chosen: a row has 1 kB; an outline has thousands at most.
_MAX_BYTES: Final = 100_000_000
_TEXTS: Final = ("frame_id", "outcome", "message")


def outline(
    estimates: Annotated[Path, typer.Argument(help="CSV of estimates, written by solve")],
    rig: Annotated[Path, typer.Option(help="rig.json, or the observations folder it is in")],
    readings: Annotated[
        Path | None,
        typer.Option(
            help="table like metadata.csv with the poses of the carriage, beside the images",
            show_default="those of the observations folder",
        ),
    ] = None,
    out: Annotated[Path, typer.Option(help="CSV to write")] = Path("outline.csv"),
) -> None:
    """Estimate the outline of an object that was touched from many poses of the antenna."""
    if readings is None:
        observations = open_observations(rig)
        frames, nominal = observations.frames, observations.rig
    else:
        frames, nominal = tuple(read_frames(readings)), read_rig(rig_file(rig))
    prepare_output_path(out, (estimates, rig_file(rig), *((readings,) if readings else ())))
    result = fit_outline(contacts_of(read_estimates(estimates), frames, nominal))
    write(out, outline_csv(result).encode())
    print(summary(result))


def read_estimates(path: Path) -> list[Row]:
    """Read a CSV that `solve` has written; empty cells are None. Raises InputError."""
    rows = list(csv_rows(path, _MAX_BYTES))
    for name in ("frame_id", "outcome"):
        if rows and name not in rows[0].cells:
            raise InputError(f"{path}: the column {name} is missing")
    return [{name: _cell(name, row) for name in row.cells} for row in rows]


def _cell(name: str, row: CsvRow) -> float | str | None:
    value = row.cells[name]
    if not value or name in _TEXTS:
        return value or None
    try:
        number = row.number(name)
    except ValueError:  # a non-numeric extra column
        return value
    if not math.isfinite(number):
        row.refuse(f"{name} is {quoted(value)}, allowed is a finite number")
    return number


def outline_csv(outline: Outline) -> str:
    """Format an outline as CSV, a row per normal, floats in full precision."""
    lengths = np.column_stack([outline.points, outline.sigmas, outline.nearest_contact])
    values = np.column_stack([outline.normals / DEGREE, lengths / MILLIMETRE])
    return csv_text([dict(zip(COLUMNS, row, strict=True)) for row in values.tolist()], COLUMNS)


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
