"""Rows of a truth table that is complete, for tests that need only some of its columns."""

from typing import Any

from vbaa_bench.dataset.dataset_columns import TRUTH_SCHEMA


def complete_row(**values: Any) -> dict[str, Any]:
    """A row with every column that a reader requires, and these values; without frame_id."""
    row = {**dict.fromkeys(TRUTH_SCHEMA.required, 0), **dict.fromkeys(TRUTH_SCHEMA.present)}
    row |= {"push_id": "p", "push": "", **values}
    row.pop("frame_id")
    if row["x_c_mm"] is not None:  # the quantities of a contact exist together
        row |= {name: 0.0 for name in TRUTH_SCHEMA.together if row.get(name) is None}
    return row
