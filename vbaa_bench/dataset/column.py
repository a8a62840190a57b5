"""A column or key of a file: meaning, unit, frame of reference, type, and when it is missing.

Each is declared once. The check of tables, the data dictionary and the descriptions in exports
follow from the declaration.
"""

from collections.abc import Mapping
from enum import Enum, StrEnum
from typing import Final, NamedTuple

import polars as pl

from solver.instrument.units import unit_of


class Kind(Enum):
    """What a column holds, and how a message says so; VECTOR is a list of three numbers."""

    NUMBER = "numbers"
    INTEGER = "whole numbers"
    TEXT = "texts"
    FLAG = "true or false"
    NUMBERS = "lists of numbers"
    VECTOR = "vectors of three numbers"

    @property
    def dtype(self) -> pl.DataType:
        """Type of the column in a table."""
        return _DTYPES[self]


_DTYPES: Final = {
    Kind.NUMBER: pl.Float64(),
    Kind.INTEGER: pl.Int64(),
    Kind.TEXT: pl.String(),
    Kind.FLAG: pl.Boolean(),
    Kind.NUMBERS: pl.List(pl.Float64),
    Kind.VECTOR: pl.List(pl.Float64),
}


class Presence(StrEnum):
    """Whether a table must have a column."""

    OPTIONAL = "older tables, and those of other scenes, may not have it"
    PRESENT = "every table has it"
    COMPLETE = "every table has it, without nulls"


class Column(NamedTuple):
    """Description of a column or key; `null` says when it is null, and is empty for never."""

    meaning: str
    frame: str = ""
    null: str = ""
    kind: Kind = Kind.NUMBER
    presence: Presence = Presence.OPTIONAL


CLAMP: Final = "clamp"
SIGMA_A: Final = "Sigma_a"
SIGMA_D: Final = "Sigma_d"
SIGMA_O: Final = "Sigma_o"
TABLE: Final = "table"
ALONG_X: Final = "Sigma_a, x axis"
FREE: Final = "nothing is touched"


def markdown(columns: Mapping[str, Column]) -> str:
    """Describe columns as a table of Markdown: name, unit, frame, meaning and null."""
    lines = ["| name | unit | frame | meaning | null |", "|---|---|---|---|---|"]
    for name, column in columns.items():
        cells = (f"`{name}`", unit_of(name).text, column.frame, column.meaning, column.null)
        texts = (" ".join(cell.split()).replace("|", "\\|") for cell in cells)
        lines.append(f"| {' | '.join(texts)} |")
    return "\n".join(lines)
