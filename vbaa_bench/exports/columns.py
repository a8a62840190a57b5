"""Columns of exported tables: their types, which of them are readings, and their descriptions."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import polars as pl

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


def _usual(dtype: pl.DataType) -> pl.DataType:
    if dtype == pl.List(pl.Null()):
        return pl.List(pl.Float64())
    return pl.Float64() if dtype == pl.Null() else dtype


def description(name: str) -> Column:
    """Return the entry of the data dictionary for a column."""
    entries = {**TRUTH, **READINGS, **PLACE}
    return entries.get("drawn.*" if name.startswith("drawn.") else name, Column(""))
