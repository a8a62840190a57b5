"""Answers for photographs as a table, as JSON and as text, with units in the names."""

import json
from typing import Any, Final

from solver.instrument.units import DEGREE, MILLIMETRE, NEWTON_SQUARE_MILLIMETRE, PERCENT
from solver.lab.table import csv_text
from solver.photographs.answer import Value
from solver.photographs.solve import PhotosAnswer

# Names of the values: of the column, of that of its sigma, and the unit.
_VALUES: Final = {
    "s_c_m": ("s_c_mm", "s_c_sigma_mm", MILLIMETRE),
    "x_c_m": ("x_c_mm", "x_c_sigma_mm", MILLIMETRE),
    "y_c_m": ("y_c_mm", "y_c_sigma_mm", MILLIMETRE),
    "force_n": ("force_n", "force_sigma_n", 1.0),
    "force_over_rigidity_per_m2": (
        "force_over_rigidity_per_mm2",
        "force_over_rigidity_sigma_per_mm2",
        1 / MILLIMETRE**2,
    ),
    "clamp_tilt_rad": ("clamp_tilt_deg", "clamp_tilt_sigma_deg", DEGREE),
    "view_a_rad": ("view_a_deg", "view_a_sigma_deg", DEGREE),
    "view_b_rad": ("view_b_deg", "view_b_sigma_deg", DEGREE),
}
_SHARED: Final = {
    "flexural_rigidity_n_m2": (
        "flexural_rigidity_n_mm2",
        "flexural_rigidity_sigma_n_mm2",
        NEWTON_SQUARE_MILLIMETRE,
    ),
    "length_m": ("length_mm", "length_sigma_mm", MILLIMETRE),
    "bow_m": ("bow_mm", "bow_sigma_mm", MILLIMETRE),
    "focal_length_px": ("focal_length_px", "focal_length_sigma_px", 1.0),
}
# Names and units of the shared values in text.
_LABELS: Final = {
    "flexural_rigidity_n_m2": ("EI at the clamp", " N mm^2"),
    "length_m": ("free length", " mm"),
    "bow_m": ("bow of the tip at rest", " mm"),
    "focal_length_px": ("focal length", " px"),
    "k1": ("lens distortion k1", ""),
    "clamp_softness": ("softness of the clamp", ""),
}
_SHARES: Final = {"s_c_m": "s_c_view_share_pct", "force_n": "force_view_share_pct"}
COLUMNS: Final = (
    "file",
    "kind",
    "outcome",
    "message",
    *(name for column in _VALUES.values() for name in column[:2]),
    *_SHARES.values(),
    "chi2",
    "dof",
    "rejected",
)

Row = dict[str, str | float | int | None]


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
            row.update(_cells(value, *_VALUES[name]))
            if name in _SHARES:
                row[_SHARES[name]] = value.view_share / PERCENT
        rows.append(row)
    return rows


def shared_row(answer: PhotosAnswer) -> dict[str, float]:
    """Return what all photographs share, by column."""
    cells: dict[str, float] = {}
    for name, value in answer.shared.items():
        cells.update(_cells(value, *_shared_names(name)))
    return cells


def _shared_names(name: str) -> tuple[str, str, float]:
    return _SHARED.get(name, (name, f"{name}_sigma", 1.0))


def _cells(value: Value, name: str, sigma_name: str, unit: float) -> dict[str, float]:
    return {name: float(value.value / unit), sigma_name: float(value.sigma / unit)}


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
        label, unit = _LABELS.get(name, (name.replace("width_", "width coefficient "), ""))
        of_value, of_sigma = _cells(value, *_shared_names(name)).values()
        lines.append(f"    {label}: {of_value:.6g} +- {of_sigma:.2g}{unit}")
    return "\n".join([*lines, *(f"- {note}" for note in answer.notes)])
