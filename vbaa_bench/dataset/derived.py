"""Tables that are computed from a dataset's truth, and kept beside it in `derived/`.

DATASET/
  derived/limits.parquet   information limits: a row per frame and information set
  derived/limits.json      sha256 of this table and of the truth from which it was computed
  derived/budget.json      error budget of methods, by method and cause

A table is used only with the truth from which it was computed: `generate` may repair or extend a
dataset, and the table is then computed again.
"""

import io
import json
from typing import Any

import polars as pl

from solver.instrument.errors import DamageError, InputError
from solver.instrument.files import write_bytes
from solver.instrument.hashes import HASHES, digest, read_bytes
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.dataset.manifest import read_json

_AGAIN = "compute the limits again"


def write_limits(layout: Layout, table: pl.DataFrame, facts: dict[str, Any]) -> None:
    """Write the table of limits, with `facts` on how it was computed. Raises InputError."""
    data = io.BytesIO()
    table.write_parquet(data)
    record = {
        "truth": digest(read_bytes(layout.truth / HASHES)),
        "limits.parquet": digest(data.getvalue()),
        **facts,
    }
    try:
        layout.derived.mkdir(parents=True, exist_ok=True)
        write_bytes(layout.derived / "limits.parquet", data.getvalue())
        write_bytes(layout.derived / "limits.json", (json.dumps(record, indent=2) + "\n").encode())
    except OSError as error:
        raise InputError(f"{layout.derived}: cannot be written ({error.strerror})") from error


def read_limits(layout: Layout) -> pl.DataFrame | None:
    """Read the table of limits; None if it was never computed.

    Raises DamageError if it is not what was written, or was computed from another truth.
    """
    table, record = layout.derived / "limits.parquet", layout.derived / "limits.json"
    if not table.is_file() and not record.is_file():
        return None
    facts, data = read_json(record), read_bytes(table)
    if facts.get("limits.parquet") != digest(data):
        raise DamageError(f"{table}: is not what was computed; {_AGAIN}")
    if facts.get("truth") != digest(read_bytes(layout.truth / HASHES)):
        raise DamageError(f"{table}: was computed from another truth; {_AGAIN}")
    return pl.read_parquet(io.BytesIO(data))
