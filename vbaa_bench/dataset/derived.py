"""Tables that are computed from a dataset's truth, and kept beside it in `derived/`.

DATASET/
  derived/limits.parquet   information limits: a row per frame and information set
  derived/budget.json      error budget of methods, by method and cause
  derived/hashes.json      sha256 of these files

The limits are used only with the truth from which they were computed, whose sha256 is in their
file: `generate` may repair or extend a dataset, and the table is then computed again.
"""

import io
from typing import Final

import polars as pl

from solver.instrument.errors import DamageError
from solver.instrument.hashes import HASHES, digest, read_bytes
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.dataset.recorded import exists, write_results
from vbaa_bench.dataset.tables import MAX_SCORED_VALUES, read_parquet

LIMITS: Final = "limits.parquet"
# Key of the file's metadata: the sha256 of truth/hashes.json.
_TRUTH: Final = "truth"
_AGAIN: Final = "compute the limits again"


def write_limits(layout: Layout, table: pl.DataFrame) -> None:
    """Write the table of limits. Raises InputError."""
    data = io.BytesIO()
    table.write_parquet(data, metadata={_TRUTH: digest(read_bytes(layout.truth / HASHES))})
    write_results(layout.derived, {LIMITS: data.getvalue()})


def read_limits(layout: Layout) -> pl.DataFrame | None:
    """Read the table of limits; None if it was never computed.

    Raises DamageError if it is not what was written, or was computed from another truth.
    """
    path = layout.derived / LIMITS
    if not exists(path):
        return None
    data = read_bytes(path)
    table = read_parquet(path, data, max_values=MAX_SCORED_VALUES)
    if truth_of_limits(data) != digest(read_bytes(layout.truth / HASHES)):
        raise DamageError(f"{path}: was computed from another truth; {_AGAIN}")
    return table


def truth_of_limits(data: bytes) -> str | None:
    """Return the sha256 of the truth/hashes.json from which a table of limits was computed.

    `data` are the bytes of the table. Raises PolarsError if they are no Parquet table.
    """
    return pl.read_parquet_metadata(io.BytesIO(data)).get(_TRUTH)
