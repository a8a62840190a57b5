"""Columns of exported tables: their types, which of them are readings, and their descriptions."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Final

import polars as pl

from solver.instrument.errors import InputError
from vbaa_bench.dataset.column import Column, Kind
from vbaa_bench.dataset.dataset_columns import JOINED, READINGS, TRUTH

CENTRELINE: Final = "centreline_"
# Columns that are added to those of metadata.csv and truth.parquet. `shard` is not exported.
PLACE: Final = {
    "rig": Column("folder of the rig, as in rig_00000; rig for a single dataset"),
    "split": Column("part of the set for training or testing; train if there are no splits"),
}
SHARD: Final = "shard"
VECTORS: Final = frozenset(name for name, one in TRUTH.items() if one.kind is Kind.VECTOR)


@dataclass(frozen=True)
class Schema:
    """Columns with their types, the same in all rigs and shards."""

    types: Mapping[str, pl.DataType]

    def applied(self, table: pl.DataFrame) -> pl.DataFrame:
        """Return the table with exactly these columns; a missing column is null."""
        return table.select(
            (pl.col(name) if name in table.columns else pl.lit(None)).cast(dtype).alias(name)
            for name, dtype in self.types.items()
        )

    def with_usual_types(self) -> "Schema":
        """Choose numbers for columns that are null in all frames, such as drawn values."""
        return Schema({name: _usual(dtype) for name, dtype in self.types.items()})

    def with_centrelines(self, wanted: bool) -> "Schema":
        """Add the columns of centrelines if they are wanted."""
        names = [name for name in TRUTH if wanted and name.startswith(CENTRELINE)]
        return Schema({**self.types, **dict.fromkeys(names, pl.List(pl.Float64()))})

    @property
    def exported(self) -> dict[str, pl.DataType]:
        """The columns that users see."""
        return {name: dtype for name, dtype in self.types.items() if name != SHARD}

    @property
    def readings(self) -> list[str]:
        """The columns that a method may use, besides the image and the place of the frame."""
        other = {*JOINED, *PLACE}
        return [name for name in self.types if name in READINGS and name not in other]

    @property
    def labels(self) -> list[str]:
        """The columns of the truth."""
        other = {*READINGS, *JOINED, *PLACE, SHARD}
        return [name for name in self.types if name not in other]


def merged_schema(schemas: Iterable[Mapping[str, pl.DataType]]) -> Schema:
    """Find one type for each column of several tables.

    Whole and real numbers become real, texts and numbers become texts. Raises InputError.
    """
    types: dict[str, pl.DataType] = {}
    for schema in schemas:
        for name, dtype in schema.items():
            types[name] = _common(name, types.get(name, pl.Null()), dtype)
    return Schema(types)


def _usual(dtype: pl.DataType) -> pl.DataType:
    if not _unknown(dtype):
        return dtype
    return pl.List(pl.Float64()) if isinstance(dtype, pl.List) else pl.Float64()


def _unknown(dtype: pl.DataType) -> bool:
    return dtype in (pl.Null(), pl.List(pl.Null()))


def _common(name: str, one: pl.DataType, two: pl.DataType) -> pl.DataType:
    if one == two or _unknown(two):
        return one
    if _unknown(one):
        return two
    if one.is_numeric() and two.is_numeric():
        return pl.Float64()
    if one.is_nested() or two.is_nested():
        raise InputError(f"the column {name} has the types {one} and {two}, allowed is one type")
    return pl.String()


def description(name: str) -> Column:
    """Return the entry of the data dictionary for a column."""
    entries = {**TRUTH, **READINGS, **PLACE}
    return entries.get("drawn.*" if name.startswith("drawn.") else name, Column(""))
