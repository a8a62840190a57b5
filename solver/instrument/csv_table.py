"""Reading of CSV tables as spreadsheets write them: separators, encodings and decimal commas."""

import csv
import io
import math
from codecs import BOM_UTF16_BE, BOM_UTF16_LE
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple, NoReturn

from solver.instrument.errors import InputError, quoted
from solver.instrument.hashes import read_bytes
from solver.instrument.units import unit_of


class CsvRow(NamedTuple):
    """Row of a table: its file and line, its cells by column, and the decimal mark of numbers."""

    where: str
    cells: dict[str, str]
    decimal_mark: str

    def refuse(self, reason: str) -> NoReturn:
        """Raise InputError with the place of the row."""
        raise InputError(f"{self.where}: {reason}")

    def number(self, column: str) -> float:
        """Convert a cell to a number. Raises ValueError."""
        return float(self.cells[column].replace(self.decimal_mark, "."))

    def quantity(self, column: str, allowed: str, above: float = -math.inf) -> float:
        """Convert a cell to SI units, by the unit that its column states.

        Raises InputError, with what is `allowed`, unless it is a finite number above `above`.
        """
        try:
            value = self.number(column)
        except (KeyError, ValueError):
            value = math.nan
        if not above < value < math.inf:
            self.refuse(f"{column} is {quoted(self.cells.get(column, ''))}, allowed is {allowed}")
        return value * unit_of(column).factor


def csv_rows(path: Path, max_bytes: int | None = None) -> Iterator[CsvRow]:
    """Read the rows of a CSV in UTF-8 or, with a byte order mark, in UTF-16. Raises InputError.

    Columns are separated by commas or, as in countries with a decimal comma, by semicolons or tabs;
    numbers then have decimal commas or points. A file of more than `max_bytes` is refused.
    """
    text = _decoded(path, max_bytes)
    head = text.partition("\n")[0]
    separator = next((mark for mark in ",;\t" if mark in head), ",")
    reader = csv.DictReader(io.StringIO(text, newline=""), delimiter=separator, restval="")
    try:
        for row in reader:
            if any(row.pop(None, ())):  # the key of the cells to spare
                raise InputError(
                    f"{path}:{reader.line_num}: has more cells than the table has columns; a "
                    "number with a decimal comma is two cells: write decimal points"
                )
            yield CsvRow(f"{path}:{reader.line_num}", row, "." if separator == "," else ",")
    except csv.Error as error:
        raise InputError(f"{path}:{reader.line_num + 1}: is not CSV ({error})") from error


def _decoded(path: Path, max_bytes: int | None) -> str:
    content = read_bytes(path, max_bytes)
    wide = content.startswith((BOM_UTF16_LE, BOM_UTF16_BE))
    try:
        text = content.decode("utf-16" if wide else "utf-8-sig")
    except UnicodeDecodeError as error:
        name = "UTF-16" if wide else "UTF-8"
        raise InputError(
            f"{path}: cannot be read as {name} text ({error}): save it as 'CSV UTF-8'"
        ) from error
    if "\0" in text[:100]:
        raise InputError(
            f"{path}: is UTF-16 without a byte order mark, or no text: save it as 'CSV UTF-8'"
        )
    return text
