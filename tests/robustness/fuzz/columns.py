"""Mistakes in tables: columns, types, rows and cells."""

import datetime
import io
import random
from collections.abc import Callable, Sequence
from typing import Any, Final

import polars as pl

from tests.robustness.fuzz.damage import damaged

# Values of a whole column, each of its own type.
_COLUMNS: Final[Sequence[Callable[[int], pl.Series]]] = (
    lambda n: pl.Series([None] * n),
    lambda n: pl.Series([None] * n, dtype=pl.Float64),
    lambda n: pl.Series(["x"] * n),
    lambda n: pl.Series([""] * n),
    lambda n: pl.Series(["nan"] * n),
    lambda n: pl.Series(["\x1b[31m\u202e[red]" + "y" * 3000] * n),
    lambda n: pl.Series([True] * n),
    lambda n: pl.Series([0] * n),
    lambda n: pl.Series([-1] * n, dtype=pl.Int8),
    lambda n: pl.Series([2**63 - 1] * n),
    lambda n: pl.Series([2**64 - 1] * n, dtype=pl.UInt64),
    lambda n: pl.Series([float("nan")] * n),
    lambda n: pl.Series([float("inf")] * n),
    lambda n: pl.Series([1e308] * n),
    lambda n: pl.Series([-1e-320] * n),
    lambda n: pl.Series([1.5] * n, dtype=pl.Float32),
    lambda n: pl.Series([[1.0, 2.0, 3.0]] * n),
    lambda n: pl.Series([[1.0]] * n),
    lambda n: pl.Series([[]] * n, dtype=pl.List(pl.Float64)),
    lambda n: pl.Series([["a", None]] * n),
    lambda n: pl.Series([[[1.0]]] * n),
    lambda n: pl.Series([{"a": 1}] * n),
    lambda n: pl.Series([b"\xff\x00"] * n),
    lambda n: pl.Series([datetime.date(2001, 1, 1)] * n),
    lambda n: pl.Series([datetime.timedelta(1)] * n),
    lambda n: pl.Series(["x"] * n, dtype=pl.Categorical),
    lambda n: pl.Series([1] * n).cast(pl.Decimal(20, 3)),
    lambda n: pl.Series([[1.0, 2.0]] * n, dtype=pl.Array(pl.Float64, 2)),
)
# Chosen: a hundred times a table twice would be a file of a gigabyte, which belongs to no case.
_MAX_ROWS: Final = 2000
_CELLS: Final[Sequence[Any]] = (
    *(None, "", "x", "nan", "inf", "-inf", "1e999", "-1", "0", "1,5", "1_000", "0x10", " 1 "),
    *("1e308", "9" * 400, "\u202e", "a\nb", 'a"b', "\x1b[31m", "=1+1", "../../x", "\x00", "true"),
    *("1e-320", "٣"),
)


def mutated_table(table: pl.DataFrame, chance: random.Random) -> pl.DataFrame:
    """Make one to three mistakes in a table."""
    for _ in range(chance.choice((1, 1, 2, 3))):
        if table.width:
            table = chance.choice(_MISTAKES)(table, chance)
    return table


def parquet_bytes(table: pl.DataFrame, chance: random.Random) -> bytes:
    """Write a table as Parquet, some of them damaged."""
    stream = io.BytesIO()
    table.write_parquet(stream, compression=chance.choice(("zstd", "snappy", "uncompressed")))
    data = stream.getvalue()
    return damaged(data, chance) if chance.random() < 0.15 else data


def csv_bytes(table: pl.DataFrame, chance: random.Random) -> bytes:
    """Write a table as CSV, some with other separators or damaged."""
    plain = table.select(
        pl.col(name)
        if not (dtype.is_nested() or dtype in (pl.Binary, pl.Duration))
        else pl.lit("[]").alias(name)
        for name, dtype in table.schema.items()
    )
    separator = chance.choice((",", ",", ",", ";", "\t"))
    data = plain.write_csv(
        separator=separator,
        include_bom=chance.random() < 0.1,
        quote_style=chance.choice(("necessary", "always", "never")),
    ).encode()
    return damaged(data, chance) if chance.random() < 0.25 else data


def _name(table: pl.DataFrame, chance: random.Random) -> str:
    return chance.choice(table.columns)


def _dropped(table: pl.DataFrame, chance: random.Random) -> pl.DataFrame:
    return table.drop(_name(table, chance))


def _renamed(table: pl.DataFrame, chance: random.Random) -> pl.DataFrame:
    old = _name(table, chance)
    new = chance.choice((f"{old} ", old.upper(), "", "x" * 3000, "\x1b[31m", "[red]", "ü", "a\nb"))
    return table if new in table.columns else table.rename({old: new})


def _swapped(table: pl.DataFrame, chance: random.Random) -> pl.DataFrame:
    one, other = _name(table, chance), _name(table, chance)
    columns = {one: table[other].alias(one), other: table[one].alias(other)}
    return table.with_columns(columns.values())


def _retyped(table: pl.DataFrame, chance: random.Random) -> pl.DataFrame:
    name = _name(table, chance)
    return table.with_columns(chance.choice(_COLUMNS)(table.height).alias(name))


def _added(table: pl.DataFrame, chance: random.Random) -> pl.DataFrame:
    name = chance.choice(("extra", "", "split", "x" * 3000, "\x1b[31m", "frame_id2", "rig"))
    return table.with_columns(chance.choice(_COLUMNS)(table.height).alias(name))


def _cast(table: pl.DataFrame, chance: random.Random) -> pl.DataFrame:
    dtype = chance.choice((pl.String, pl.Float32, pl.Int64, pl.Boolean, pl.Categorical))
    return table.with_columns(_strict_free(table[_name(table, chance)], dtype))


def _strict_free(column: pl.Series, dtype: Any) -> pl.Series:
    try:
        return column.cast(dtype, strict=False)
    except pl.exceptions.PolarsError:
        return column


def _cell(table: pl.DataFrame, chance: random.Random) -> pl.DataFrame:
    """Replace a value; the column keeps its type if the new value has it, and else is a text."""
    name, value = _name(table, chance), chance.choice(_CELLS)
    column = table[name]
    if column.dtype.is_nested() or not table.height:
        return _retyped(table, chance)
    number = chance.randrange(table.height)
    if column.dtype.is_numeric():
        value = chance.choice((None, 0, -1, float("nan"), float("inf"), 1e308, 1e-320, 1e18, value))
    if column.dtype.is_float() and isinstance(value, int | float):
        values: list[Any] = column.to_list()
        values[number] = float(value)
        return table.with_columns(pl.Series(name, values, dtype=column.dtype))
    texts = _strict_free(column, pl.String).to_list()
    texts[number] = None if value is None else str(value)
    return table.with_columns(pl.Series(name, list(map(_text, texts)), dtype=pl.String))


def _text(value: Any) -> str | None:
    return None if value is None else str(value)


def _fewer(table: pl.DataFrame, chance: random.Random) -> pl.DataFrame:
    return table.head(chance.choice((0, 1, max(table.height - 1, 0))))


def _repeated(table: pl.DataFrame, chance: random.Random) -> pl.DataFrame:
    return pl.concat([table] * chance.choice((2, 2, 100))).head(_MAX_ROWS)


def _shuffled(table: pl.DataFrame, chance: random.Random) -> pl.DataFrame:
    order = list(range(table.height))
    chance.shuffle(order)
    names = list(table.columns)
    chance.shuffle(names)
    return table[order].select(names)


_MISTAKES: Final[Sequence[Callable[[pl.DataFrame, random.Random], pl.DataFrame]]] = (
    *(_dropped, _dropped, _renamed, _swapped, _retyped, _retyped, _retyped, _added, _cast, _cell),
    *(_cell, _cell, _fewer, _repeated, _shuffled),
)
