"""Fuzzed tables of a dataset or collection, read by the commands that use them."""

import io
import random
from collections.abc import Callable
from pathlib import Path
from typing import Final

import polars as pl

from solver.instrument.observation import open_observations
from tests.robustness.fuzz.columns import csv_bytes, mutated_table, parquet_bytes
from tests.robustness.fuzz.damage import damaged
from tests.robustness.fuzz.datasets import copied, replaced
from tests.robustness.fuzz.uses import (
    compare,
    merge,
    report,
    score,
    store_baseline,
    table,
    warm_up,
)
from vbaa_bench.scoring.conditions import CONDITIONS, STRATA
from vbaa_bench.scoring.tables import FORMATS

_TRUTH: Final = "truth/shard_00000/truth.parquet"
_METADATA: Final = "observations/shard_00000/metadata.csv"
# Share of tables with damaged bytes.
_BYTES: Final = 0.15


class Tables:
    """Replaces a table of a scored dataset or of a collection, and runs a command on it."""

    def __init__(self, material: Path) -> None:
        """Find the valid tables of `material`/dataset and `material`/collection."""
        warm_up(material)
        self._dataset, self._collection = material / "dataset", material / "collection"
        self._baseline = material / "baseline.json"

    def attempt(self, chance: random.Random, folder: Path) -> None:
        """Copy a dataset with mistakes in one table, and use it."""
        name = chance.choice((_TRUTH, _TRUTH, _METADATA, "scores/scores.parquet", "rigs.csv"))
        source = self._collection if name == "rigs.csv" else self._dataset
        root = copied(source, folder / "data")
        data = (source / name).read_bytes()
        if chance.random() < _BYTES:
            data = damaged(data, chance)
        elif name.endswith(".parquet"):
            data = parquet_bytes(mutated_table(pl.read_parquet(io.BytesIO(data)), chance), chance)
        else:
            valid = pl.read_csv(io.BytesIO(data), infer_schema=False)
            data = csv_bytes(mutated_table(valid, chance), chance)
        replaced(root, root / name, data, sealed=chance.random() < 0.95)
        self._use(name, chance, root)

    def _use(self, name: str, chance: random.Random, root: Path) -> None:
        if name == _METADATA:
            for frame in open_observations(root / "observations"):
                frame.image()
        elif name == "rigs.csv":
            merge(root)
        else:
            by = chance.choice((None, *CONDITIONS, *STRATA))
            uses: list[Callable[[], None]] = [
                lambda: score(root),
                lambda: table(root, by, chance.choice(tuple(FORMATS))),
                lambda: report(root),
                lambda: compare(root, self._baseline),
                lambda: store_baseline(root, root.parent / "out.json"),
            ]
            chance.choice(uses)()
