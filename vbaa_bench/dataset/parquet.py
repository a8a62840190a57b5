"""Reader of Parquet tables from memory, with a limit on what they unpack to."""

import io
from collections.abc import Callable
from pathlib import Path
from typing import Final

import polars as pl

from solver.instrument.errors import InputError, truncated
from vbaa_bench.dataset.table_schema import Schema, check_types

# Largest numbers of values of a shard or a predictions file, and of scores or limits. A few bytes
# can unpack to any number of equal values. Chosen: a million frames of 100 columns, 0.8 GB; ten
# methods on as many frames.
MAX_VALUES: Final = 10**8
MAX_SCORED_VALUES: Final = 10**9


def read_parquet(
    path: Path,
    data: bytes,
    chosen: Callable[[str], bool] = lambda _name: True,
    max_values: int = MAX_VALUES,
    schema: Schema | None = None,
) -> pl.DataFrame:
    """Parse the bytes of a Parquet table; only columns whose names are `chosen` are read.

    Raises InputError if it is no such table, has too many values or, before any value is read, if
    a column has another type than in `schema`; `path` is for the message.
    """
    try:
        dtypes = pl.read_parquet_schema(io.BytesIO(data))
        names = [name for name in dtypes if chosen(name)]
        if schema is not None:
            check_types({name: dtypes[name] for name in names}, schema, str(path))
        rows = max_values // max(len(names), 1)
        # As the file's last bytes state it. They may be wrong, so no more is read than is allowed.
        stated = pl.scan_parquet(io.BytesIO(data)).select(pl.len()).collect().item()
        if stated <= rows:
            table = pl.read_parquet(io.BytesIO(data), columns=names, n_rows=rows + 1)
    # Polars panics on some damaged files.
    except (OSError, pl.exceptions.PolarsError, pl.exceptions.PanicException) as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise InputError(f"{path}: is not a Parquet table ({truncated(reason)})") from error
    if stated > rows or table.height > rows:
        raise InputError(
            f"{path}: has more than {rows:,} rows of {len(names)} columns, allowed are "
            f"{max_values:,} values"
        )
    return table
