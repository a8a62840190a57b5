"""What a report shows depends on what methods answer."""

import shutil
from pathlib import Path

import polars as pl
import pytest

from solver.instrument.errors import DamageError, InputError
from solver.instrument.hashes import HASHES
from tests.sealing import reseal
from vbaa_bench.dataset.derived import write_limits
from vbaa_bench.dataset.readers import open_truth
from vbaa_bench.regression.baseline import write_baseline
from vbaa_bench.regression.scored_run import read_run
from vbaa_bench.report.report import report
from vbaa_bench.scoring.results_layout import Results
from vbaa_bench.scoring.score import score
from vbaa_bench.scoring.score_columns import LIMITS


@pytest.fixture
def results(dataset: Path, tmp_path: Path) -> Results:
    shutil.copytree(dataset, tmp_path / "small")
    return Results(tmp_path / "small")


@pytest.mark.thorough
def test_psi_and_stated_errors_are_shown_where_a_method_answers_them(
    results: Results, tmp_path: Path
) -> None:
    true = open_truth(results.dataset.truth).frames
    plain = true.select("frame_id", x_c_mm=pl.col("x_c_mm") + 0.1)
    plain.write_csv(tmp_path / "plain.csv")
    more = plain.with_columns(
        psi_deg=pl.lit(2.0),
        psi_sigma_deg=pl.lit(1.0),
        x_c_sigma_mm=pl.lit(0.2),
        compliance_mm_per_n=pl.lit(0.03),
    )
    more.write_csv(tmp_path / "more.csv")
    score(results, {"plain": tmp_path / "plain.csv"})
    page = report(results).read_text(encoding="utf-8")
    for absent in ("psi RMSE", "claimed coverage", "Fig. 11", "false contacts"):
        assert absent not in page
    assert "No method states an uncertainty" in page
    assert "in 95 % interval" not in page
    assert "Not in the chart: plain (median error 0.042 % of L, no time was measured)" in page
    score(results, {name: tmp_path / f"{name}.csv" for name in ("plain", "more")})
    page = report(results).read_text(encoding="utf-8")
    for present in ("points of the profile fit", "psi RMSE", "coverage of psi"):
        assert present in page
    write_baseline(read_run(results.root), tmp_path / "first.json")
    with pytest.raises(InputError, match="every set of paired frames has fewer than nine pushes"):
        report(results, tmp_path / "first.json")
    assert "error of x_c +0.042 % of L (+0.1 mm, 0.5 stated sigmas)" in page
    table = results.scores / "scores.parquet"
    pl.read_parquet(table).drop("consistent").write_parquet(table)
    (table.parent / HASHES).unlink()  # as in older versions
    with pytest.raises(InputError, match="score the dataset again"):
        report(results)


def test_limits_of_another_truth_are_refused(results: Results, tmp_path: Path) -> None:
    true = open_truth(results.dataset.truth).frames
    true.select("frame_id", x_c_mm=pl.col("x_c_mm") + 0.2).write_csv(tmp_path / "mine.csv")
    bounds = true.select("frame_id", information=pl.lit("image"), x_c_limit_mm=pl.lit(0.1))
    empty = LIMITS.keys() - set(bounds.columns)
    none = (pl.lit(None, pl.Float64).alias(name) for name in empty)
    write_limits(results.dataset, bounds.with_columns(none))
    score(results, {"mine": tmp_path / "mine.csv"})
    page = report(results).read_text(encoding="utf-8")
    assert "information used, %" in page
    assert "<td>25</td>" in page
    (results.dataset.derived / "limits.parquet").write_bytes(b"other")
    with pytest.raises(DamageError, match=r"limits\.parquet: is not what was generated"):
        score(results, {"mine": tmp_path / "mine.csv"})


def test_a_report_is_written_where_the_solver_cannot_be_set_up(
    results: Results, tmp_path: Path
) -> None:
    true = open_truth(results.dataset.truth).frames
    true.select("frame_id", "x_c_mm").write_csv(tmp_path / "plain.csv")
    score(results, {"plain": tmp_path / "plain.csv"})
    shutil.rmtree(results.dataset.observations / "rest")
    with pytest.raises(InputError, match=r"rest_00\.png: is missing; run the command"):
        report(results)
    reseal(results.dataset)
    page = report(results).read_text(encoding="utf-8")
    assert "The solver cannot be set up" in page
    assert "points of the profile fit" not in page
