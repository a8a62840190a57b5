"""The page on a real set: its figures are those of the results, its table is read."""

import re
from pathlib import Path

import numpy as np
import polars as pl

from solver.lab.protocol import KNOWN, read_known
from tests.docs.test_figures import RESULTS, ROOT, Figure, agrees, tables

PAGE = (ROOT / "docs" / "protocol.md").read_text(encoding="utf-8")
DESIGNS = {
    "EI from the diameter": "flexural_rigidity_pct 6",
    "EI and section known by hung weights": "flexural_rigidity_pct 0.5",
}


def test_the_expected_errors_are_the_median_limits() -> None:
    limits = pl.read_csv(RESULTS / "pictures" / "protocol_limits.csv")
    (table,) = (one for one in tables(PAGE) if one.numeric)
    assert {row[0] for row in table.rows} == set(DESIGNS)
    for name, x_c, force in table.rows:
        design = limits.filter(pl.col("design") == DESIGNS[name])
        for text, column in ((x_c, "x_c_limit_pct_L"), (force, "force_limit_pct")):
            assert agrees(Figure(text, float(np.median(design[column])))), (name, column)


def test_the_example_of_known_loads_is_read(tmp_path: Path) -> None:
    block = re.search(r"```text\n(.*?)```", PAGE, re.DOTALL)
    assert block is not None
    (tmp_path / KNOWN).write_text(block[1], encoding="utf-8")
    (tmp_path / "images").mkdir()
    for name in ("weight_01.png", "push_01.png"):
        (tmp_path / "images" / name).touch()
    loads, wrong = read_known(tmp_path)
    assert wrong == []
    assert [load.load for load in loads] == ["weight", "push"]
