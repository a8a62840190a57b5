"""Parquet tables: read with a limit on their size, and with the type of every known column.

Tables come with a dataset, which may be of anyone: a column of another type, or a vector of another
length, would be a traceback far from its cause.
"""

import io
import os
import threading
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Final, NamedTuple

import polars as pl

from solver.instrument.errors import InputError, quoted, truncated
from vbaa_bench.dataset.column import Column, Kind, Presence
from vbaa_bench.dataset.document import LARGEST

# Largest numbers of values of a shard or a predictions file, and of scores or limits. A few bytes
# can unpack to any number of equal values. Chosen: a million frames of 100 columns, 0.8 GB; ten
# methods on as many frames.
MAX_VALUES: Final = 10**8
MAX_SCORED_VALUES: Final = 10**9


class Schema(NamedTuple):
    """Kinds of the known columns; `present` must exist, and `required` also have no nulls.

    Numbers of vectors and of the columns in `finite` are at most LARGEST, and not NaN. Those in
    `positive` are at least 1 / LARGEST. Columns in `together` are null in the same rows.
    """

    kinds: Mapping[str, Kind]
    required: Collection[str]
    present: Collection[str] = ()
    finite: Collection[str] = ()
    positive: Collection[str] = ()
    together: Sequence[str] = ()


def schema_of(columns: Mapping[str, Column]) -> Schema:
    """Make the schema of columns as they are declared; names with * stand for others."""
    named = {name: column for name, column in columns.items() if "*" not in name}

    def having(presence: Presence) -> list[str]:
        return [name for name, column in named.items() if column.presence is presence]

    return Schema(
        {name: column.kind for name, column in named.items()},
        having(Presence.COMPLETE),
        having(Presence.PRESENT),
    )


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
        with _BACKTRACES.dropped():
            dtypes = pl.read_parquet_schema(io.BytesIO(data))
            names = [name for name in dtypes if chosen(name)]
            if schema is not None:
                check_types({name: dtypes[name] for name in names}, schema, str(path))
            rows = max_values // max(len(names), 1)
            # As the file's last bytes state it. They may be wrong: no more is read than is allowed.
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


class _Backtraces:
    """Drops what Polars writes to standard error before its panic reaches Python as an exception.

    Its threads write to the file descriptor itself, so nothing else can be written meanwhile.
    Several threads may read at once: the first one redirects the descriptor, the last one restores
    it.
    """

    def __init__(self) -> None:
        self._lock, self._readers, self._kept = threading.Lock(), 0, -1

    @contextmanager
    def dropped(self) -> Iterator[None]:
        """Drop them within this context."""
        with self._lock:
            if self._readers == 0:
                self._redirect()
            self._readers += 1
        try:
            yield
        finally:
            with self._lock:
                self._readers -= 1
                if self._readers == 0 and self._kept >= 0:
                    os.dup2(self._kept, 2)
                    os.close(self._kept)

    def _redirect(self) -> None:
        try:
            self._kept = os.dup(2)
        except OSError:  # standard error is closed
            self._kept = -1
            return
        with Path(os.devnull).open("wb") as nowhere:
            os.dup2(nowhere.fileno(), 2)


_BACKTRACES: Final = _Backtraces()


def checked(table: pl.DataFrame, schema: Schema, source: str) -> pl.DataFrame:
    """Check a table; return it with the types of `schema`. Raises InputError."""
    for name in (*schema.required, *schema.present):
        if name not in table.columns:
            raise InputError(f"{source}: the column {name} is missing")
    for name in schema.required:
        if table[name].null_count():
            raise InputError(f"{source}: {name} is missing in a row")
    check_types(table.schema, schema, source)
    known = {name: kind for name, kind in schema.kinds.items() if name in table.columns}
    try:
        table = table.with_columns(pl.col(name).cast(kind.dtype) for name, kind in known.items())
    except pl.exceptions.PolarsError as error:
        reason = truncated(str(error).splitlines()[0])
        raise InputError(f"{source}: a column has values of a wrong type ({reason})") from error
    faults = dict(_faults(table.columns, schema))
    # One query: one for each column takes ten times as long.
    for fault, is_there in table.select(**faults).row(0, named=True).items() if faults else ():
        if is_there:
            raise InputError(f"{source}: {fault}")
    absent = [table[name].is_null() for name in schema.together]
    if any((rows != absent[0]).any() for rows in absent):
        names = ", ".join(schema.together)
        raise InputError(f"{source}: allowed in a row are all or none of {names}")
    return table


def check_types(dtypes: Mapping[str, pl.DataType], schema: Schema, source: str) -> None:
    """Check the types of a table's columns, which may not be read yet. Raises InputError."""
    for name, kind in schema.kinds.items():
        if name in dtypes and not _castable(dtypes[name], kind):
            held = truncated(str(dtypes[name]))
            raise InputError(f"{source}: {name} holds {held}, allowed are {kind.value}")


def _faults(columns: Collection[str], schema: Schema) -> Iterator[tuple[str, pl.Expr]]:
    """Yield each fault that the numbers of a table may have, and the test for it."""
    for name in [n for n, kind in schema.kinds.items() if kind is Kind.VECTOR and n in columns]:
        vectors = pl.col(name).drop_nulls()
        is_vector = (vectors.list.len() == 3).all() & _all_finite(vectors.explode(), null=False)
        yield f"{name} is not a vector of three numbers in a row", ~is_vector
    for name in columns:
        if name in schema.finite:
            fault = f"{name} is not finite, or above {LARGEST:g}, in a row"
            yield fault, ~_all_finite(pl.col(name), null=True)
    for name in columns:
        if name in schema.positive:
            is_positive = (pl.col(name) >= 1 / LARGEST).fill_null(value=True).all()
            yield f"{name} is not above {1 / LARGEST:g} in a row", ~is_positive


def _all_finite(numbers: pl.Expr, *, null: bool) -> pl.Expr:
    """Test whether numbers are finite and not absurdly large; NaN compares as larger."""
    return (numbers.abs() <= LARGEST).fill_null(value=null).all()


def _castable(dtype: pl.DataType, wanted: Kind) -> bool:
    """Test whether a column may be cast: no text to numbers, no numbers to texts."""
    if dtype in (pl.Null(), wanted.dtype):
        return True
    if wanted in (Kind.NUMBER, Kind.INTEGER):
        return dtype.is_integer() or (wanted is Kind.NUMBER and dtype.is_float())
    if wanted is Kind.TEXT:
        return dtype in (pl.Categorical, pl.Enum)
    if wanted in (Kind.NUMBERS, Kind.VECTOR) and isinstance(dtype, pl.List):
        inner = dtype.inner
        return inner == pl.Null or inner in (pl.Float32, pl.Float64, pl.Int64)
    return False


def check_unique(table: pl.DataFrame, name: str, source: str) -> None:
    """Raise InputError if a value of a column occurs twice."""
    duplicates = table.filter(pl.col(name).is_duplicated())
    if duplicates.height:
        raise InputError(f"{source}: {name} {quoted(duplicates[name][0])} occurs more than once")
