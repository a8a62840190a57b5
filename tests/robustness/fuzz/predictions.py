"""Fuzzed predictions of entrants: CSV and Parquet tables, scored."""

import io
import random
from pathlib import Path
from typing import Final

import polars as pl

from tests.robustness.fuzz.columns import csv_bytes, mutated_table, parquet_bytes
from tests.robustness.fuzz.damage import damaged
from tests.robustness.fuzz.datasets import copied
from tests.robustness.fuzz.uses import report, score, table, warm_up

_NAMES: Final = (
    *("mine", "mine", "mine", "mine", "exact_fit", "a b", "ä", "[red]", "x\x1b[31m", "a\nb", "-x"),
    *("mine@profile_fit", "a.b", " ", "y" * 200, "\u202e", "<b>", "%s"),
)
_SUFFIXES: Final = (".csv", ".csv", ".parquet", ".parquet", ".PARQUET", ".txt", "")
# Share of tables with damaged bytes.
_BYTES: Final = 0.15


class Predictions:
    """Mutates valid predictions, and scores them; some scores are then reported."""

    def __init__(self, material: Path) -> None:
        """Read the predictions of `material`/dataset."""
        warm_up(material)
        self._dataset = material / "dataset"
        paths = sorted((self._dataset / "predictions").glob("*.csv"))
        self._tables = [pl.read_csv(path) for path in paths]

    def attempt(self, chance: random.Random, folder: Path) -> None:
        """Write predictions with mistakes, and score them."""
        root = copied(self._dataset, folder / "data")
        path = folder / f"{chance.choice(_NAMES)}{chance.choice(_SUFFIXES)}"
        valid = chance.choice(self._tables)
        as_parquet = (path.suffix == ".parquet") != (chance.random() < 0.03)
        if chance.random() < _BYTES:
            stream = io.BytesIO()
            valid.write_parquet(stream)
            data = damaged(stream.getvalue() if as_parquet else valid.write_csv().encode(), chance)
        else:
            to_bytes = parquet_bytes if as_parquet else csv_bytes
            data = to_bytes(mutated_table(valid, chance), chance)
        path.write_bytes(data)
        score(root, path)
        if chance.random() < 0.5:
            table(root)
        if chance.random() < 0.1:
            report(root)
