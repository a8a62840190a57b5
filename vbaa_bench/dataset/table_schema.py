"""Check of tables: the type of every known column.

Tables come with a dataset, which may be of anyone: a column of another type, or a vector of another
length, would be a traceback far from its cause.
"""

from collections.abc import Collection, Mapping, Sequence
from typing import Final, NamedTuple

import polars as pl

from solver.instrument.errors import InputError, quoted, truncated

NUMBER: Final = pl.Float64()
INTEGER: Final = pl.Int64()
TEXT: Final = pl.String()
FLAG: Final = pl.Boolean()
NUMBERS: Final = pl.List(pl.Float64)
# Largest number. Chosen: far beyond all results, of which sums of squares then do not overflow; a
# number of single precision holds it.
LARGEST: Final = 1e30
_WORDS: Final = {
    NUMBER: "numbers",
    INTEGER: "whole numbers",
    TEXT: "texts",
    FLAG: "true or false",
    NUMBERS: "lists of numbers",
}


class Schema(NamedTuple):
    """Types of the known columns; `present` must exist, and `required` also have no nulls.

    Columns in `vectors` hold three numbers or null. Numbers of these and of the columns in `finite`
    are at most LARGEST, and not NaN.
    Those in `positive` are at least 1 / LARGEST. Columns in `together` are null in the same rows.
    """

    types: Mapping[str, pl.DataType]
    required: Collection[str]
    present: Collection[str] = ()
    vectors: Collection[str] = ()
    finite: Collection[str] = ()
    positive: Collection[str] = ()
    together: Sequence[str] = ()


def checked(table: pl.DataFrame, schema: Schema, source: str) -> pl.DataFrame:
    """Check a table; return it with the types of `schema`. Raises InputError."""
    for name in (*schema.required, *schema.present):
        if name not in table.columns:
            raise InputError(f"{source}: the column {name} is missing")
    for name in schema.required:
        if table[name].null_count():
            raise InputError(f"{source}: {name} is missing in a row")
    check_types(table.schema, schema, source)
    known = {name: dtype for name, dtype in schema.types.items() if name in table.columns}
    try:
        table = table.with_columns(pl.col(name).cast(dtype) for name, dtype in known.items())
    except pl.exceptions.PolarsError as error:
        reason = truncated(str(error).splitlines()[0])
        raise InputError(f"{source}: a column has values of a wrong type ({reason})") from error
    for name in [name for name in known if name in schema.vectors]:
        vectors = table[name].drop_nulls()
        numbers = vectors.explode()
        if not (vectors.list.len() == 3).all() or not _all_finite(numbers, null=False):
            raise InputError(f"{source}: {name} is not a vector of three numbers in a row")
    for name in [name for name in table.columns if name in schema.finite]:
        if not _all_finite(table[name], null=True):
            raise InputError(f"{source}: {name} is not finite, or above {LARGEST:g}, in a row")
    for name in [name for name in table.columns if name in schema.positive]:
        if not (table[name] >= 1 / LARGEST).fill_null(value=True).all():
            raise InputError(f"{source}: {name} is not above {1 / LARGEST:g} in a row")
    absent = [table[name].is_null() for name in schema.together]
    if any((rows != absent[0]).any() for rows in absent):
        names = ", ".join(schema.together)
        raise InputError(f"{source}: allowed in a row are all or none of {names}")
    return table


def check_types(dtypes: Mapping[str, pl.DataType], schema: Schema, source: str) -> None:
    """Check the types of a table's columns, which may not be read yet. Raises InputError."""
    for name, dtype in schema.types.items():
        if name in dtypes and not _castable(dtypes[name], dtype):
            held = truncated(str(dtypes[name]))
            raise InputError(f"{source}: {name} holds {held}, allowed are {_WORDS[dtype]}")


def _all_finite(numbers: pl.Series, *, null: bool) -> bool:
    """Test whether numbers are finite and not absurdly large; NaN compares as larger."""
    return bool((numbers.abs() <= LARGEST).fill_null(value=null).all())


def _castable(dtype: pl.DataType, wanted: pl.DataType) -> bool:
    """Test whether a column may be cast: no text to numbers, no numbers to texts."""
    if dtype in (pl.Null(), wanted):
        return True
    if wanted in (NUMBER, INTEGER):
        return dtype.is_integer() or (wanted == NUMBER and dtype.is_float())
    if wanted == TEXT:
        return dtype in (pl.Categorical, pl.Enum)
    if wanted == NUMBERS and isinstance(dtype, pl.List):
        inner = dtype.inner
        return inner == pl.Null or inner in (pl.Float32, pl.Float64, pl.Int64)
    return False


def check_unique(table: pl.DataFrame, name: str, source: str) -> None:
    """Raise InputError if a value of a column occurs twice."""
    duplicates = table.filter(pl.col(name).is_duplicated())
    if duplicates.height:
        raise InputError(f"{source}: {name} {quoted(duplicates[name][0])} occurs more than once")
