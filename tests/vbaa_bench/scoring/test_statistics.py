"""Statistics as arrays and as expressions, and a score that is declared once."""

import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from tests.vbaa_bench.scoring.worlds import truth
from vbaa_bench.report import console
from vbaa_bench.scoring import tables
from vbaa_bench.scoring.frame_scores import score_frames
from vbaa_bench.scoring.predictions import checked_predictions
from vbaa_bench.scoring.scored_quantities import X_C
from vbaa_bench.scoring.statistics import (
    COUNT,
    FACTOR,
    INFORMATION_USED,
    LARGEST,
    MEAN,
    MEDIAN,
    P05,
    P95,
    REPORT_TABLE,
    RMS,
    SUMMARY,
    TABLE,
    Reduction,
    Statistic,
    error_statistics,
)
from vbaa_bench.scoring.strata_table import strata_rows
from vbaa_bench.scoring.summary import calibration


@pytest.mark.parametrize(
    "reduction", [COUNT, INFORMATION_USED, LARGEST, MEAN, MEDIAN, P05, P95, RMS]
)
def test_a_reduction_of_an_array_is_that_of_a_column(
    reduction: Reduction, random: np.random.Generator
) -> None:
    values = random.normal(1, 1, 101)
    rows = pl.DataFrame({"x": [*values, None]})
    statistic = Statistic("", reduction, pl.col("x"))
    assert statistic.of(rows) == reduction.of(values)
    assert rows.select(statistic.expression).item() == pytest.approx(reduction.of(values), 1e-12)
    nothing = rows.clear()
    assert statistic.of(nothing) == nothing.select(statistic.expression).item() == reduction.empty


def test_only_frames_that_meet_the_condition_count() -> None:
    rows = pl.DataFrame({"x": [1.0, 3.0, 8.0], "counts": [True, True, False]})
    mean = Statistic("", MEAN, pl.col("x"), where=pl.col("counts"))
    ratio = Statistic("", MEAN, pl.col("x"), over=mean)
    undefined = Statistic("", MEAN, pl.col("x"), defined=pl.col("counts").all())
    for statistic, value in ((mean, 2.0), (ratio, 2.0), (undefined, None)):
        assert statistic.of(rows) == value
        assert rows.select(statistic.expression).item() == value


def test_each_figure_of_a_table_has_a_heading_of_its_own() -> None:
    declared = SUMMARY | TABLE
    for heads in (
        [declared[name].heading.table for name in tables._COLUMNS],
        [declared[name].heading.report for name in (*console._SCORES, "n")],
        [one.heading.report for one in FACTOR.values()],
        [one.heading.report for one in REPORT_TABLE.values()],
    ):
        assert all(heads)
        assert len(set(heads)) == len(heads)


def test_without_any_error_there_is_no_ratio_of_sigma_and_error() -> None:
    exact = pl.DataFrame({"frame_id": ["f0", "f1"], "x_c_mm": 120.0, "x_c_sigma_mm": 0.1})
    scores = score_frames(truth({}, {}), checked_predictions(exact, ""), "mine", "")
    (row,) = [one for one in strata_rows(scores) if one["stratum"] == "all"]
    stated = calibration(scores, X_C)
    assert stated is not None
    assert row["rmse"] == row["nees"] == stated["nees"] == 0
    assert row["sigma_over_rmse"] is stated["sigma_over_rmse"] is None
    assert scores.select(error_statistics(X_C)["sigma_over_rmse"].expression).item() is None


_DECLARED_ONCE = """
import sys
from pathlib import Path
import polars as pl
from vbaa_bench.dataset.column import Column, Presence, SIGMA_D
from vbaa_bench.scoring.computed_scores import COMPUTED, FAILED, ComputedScore

COMPUTED["y_c_error_pct_L"] = ComputedScore(
    Column("error of y_c", SIGMA_D, FAILED, presence=Presence.PRESENT),
    lambda length_mm: 100 * pl.col("y_c_error_mm") / length_mm,
    "y_c RMSE, % of L",
)

from vbaa_bench.report import dictionary
from vbaa_bench.report.report import report
from vbaa_bench.scoring.accuracy import accuracy
from vbaa_bench.scoring.results_layout import Results
from vbaa_bench.scoring.score import read_scores, score
from vbaa_bench.scoring.tables import Shown, markdown

root, own = map(Path, sys.argv[1:])
results = Results(root)
summary = score(results, {"own": own})
assert abs(summary["methods"]["own"]["y_c_rmse_pct_L"] - 1) < 1e-9
assert "y_c_error_pct_L" in read_scores(results).columns
assert "`y_c_error_pct_L` | % of L | Sigma_d | error of y_c |" in dictionary.page()
assert "| y_c RMSE, % of L |" in markdown(accuracy([root]), Shown())
page = report(results, set_up_antenna=lambda _: (None, "not here")).read_text("utf-8")
assert '<th scope="col">y_c RMSE, % of L</th>' in page
"""


@pytest.mark.thorough  # a process of its own, in which the score is declared first
def test_a_score_is_declared_once(dataset: Path, tmp_path: Path) -> None:
    results = shutil.copytree(dataset, tmp_path / "small")
    frames = pl.read_parquet(next(results.rglob("truth.parquet")))
    own = tmp_path / "own.csv"
    frames.select(
        "frame_id", "x_c_mm", pl.col("y_c_mm") + 2.4, "force_n", outcome=pl.lit("contact")
    ).write_csv(own)
    command = [sys.executable, "-c", _DECLARED_ONCE, str(results), str(own)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
