"""Answers for photographs as a table, as JSON and as text, with units in the names."""

import json
from typing import Any, Final

from solver.instrument.quantities import Column
from solver.instrument.units import PERCENT, unit_of
from solver.lab.table import Row, csv_text
from solver.photographs.answer import Value
from solver.photographs.solve import PhotosAnswer

# Columns of the values of a photograph, and of those that photographs share.
_VALUES: Final = {
    "s_c_m": Column("s_c_mm"),
    "x_c_m": Column("x_c_mm"),
    "y_c_m": Column("y_c_mm"),
    "force_n": Column("force_n"),
    "force_over_rigidity_per_m2": Column("force_over_rigidity_per_mm2"),
    "clamp_tilt_rad": Column("clamp_tilt_deg"),
    "view_a_rad": Column("view_a_deg"),
    "view_b_rad": Column("view_b_deg"),
}
_SHARED: Final = {
    "flexural_rigidity_n_m2": Column("flexural_rigidity_n_mm2"),
    "length_m": Column("length_mm"),
    "bow_m": Column("bow_mm"),
    "focal_length_px": Column("focal_length_px"),
}
# Names of the shared values in text.
_LABELS: Final = {
    "flexural_rigidity_n_m2": "EI at the clamp",
    "length_m": "free length",
    "bow_m": "bow of the tip at rest",
    "focal_length_px": "focal length",
    "k1": "lens distortion k1",
    "clamp_softness": "softness of the clamp",
}
_SHARES: Final = {"s_c_m": "s_c_view_share_pct", "force_n": "force_view_share_pct"}
COLUMNS: Final = (
    "file",
    "kind",
    "outcome",
    "message",
    *(name for column in _VALUES.values() for name in (column.name, column.sigma_name)),
    *_SHARES.values(),
    "chi2",
    "dof",
    "rejected",
)


def rows_of(answer: PhotosAnswer) -> list[Row]:
    """Build a row per photograph; what is not estimated is None, an empty cell."""
    rows = []
    for photo, one in zip(answer.photos.photographs, answer.answers, strict=True):
        row: Row = dict.fromkeys(COLUMNS)
        row.update(
            file=photo.path.name,
            kind=photo.load.kind if photo.load else "rest",
            outcome=str(one.outcome),
            message=one.message,
            chi2=one.chi2,
            dof=one.dof,
            rejected=one.rejected,
        )
        for name, value in one.values.items():
            row.update(_cells(value, _VALUES[name]))
            if name in _SHARES:
                row[_SHARES[name]] = value.view_share / PERCENT
        rows.append(row)
    return rows


def shared_row(answer: PhotosAnswer) -> dict[str, float]:
    """Return what all photographs share, by column."""
    cells: dict[str, float] = {}
    for name, value in answer.shared.items():
        cells.update(_cells(value, _shared_column(name)))
    return cells


def _shared_column(name: str) -> Column:
    return _SHARED.get(name, Column(name))


def _cells(value: Value, column: Column) -> dict[str, float]:
    return {
        column.name: float(value.value / column.unit),
        column.sigma_name: float(value.sigma / column.unit),
    }


def table_text(answer: PhotosAnswer) -> str:
    """Format the rows as CSV, floats in full precision."""
    return csv_text(rows_of(answer), COLUMNS)


def json_line(answer: PhotosAnswer) -> str:
    """Format everything as one line of JSON."""
    document: dict[str, Any] = {
        "photos": rows_of(answer),
        "shared": shared_row(answer),
        "cannot_be_known": list(answer.notes),
    }
    return json.dumps(document, allow_nan=False)


def summary(answer: PhotosAnswer) -> str:
    """Describe the answers in lines."""
    lines = []
    for row in rows_of(answer):
        values = [
            f"{label} {row[name]:.4g} +- {row[sigma]:.2g} {unit}"
            for label, name, sigma, unit in (
                ("s_c", "s_c_mm", "s_c_sigma_mm", "mm"),
                ("F", "force_n", "force_sigma_n", "N"),
            )
            if row[name] is not None
        ]
        lines.append(f"{row['file']}: {row['outcome']}: {', '.join(values) or row['message']}")
    if answer.shared:
        lines.append("Of all photographs:")
    for name, value in answer.shared.items():
        label = _LABELS.get(name, name.replace("width_", "width coefficient "))
        column = _shared_column(name)
        of_value, of_sigma = _cells(value, column).values()
        line = f"    {label}: {of_value:.6g} +- {of_sigma:.2g} {unit_of(column.name).text}"
        lines.append(line.rstrip())
    return "\n".join([*lines, *(f"- {note}" for note in answer.notes)])
