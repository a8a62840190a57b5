"""What a report shows depends on what methods answer."""

import shutil
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from solver.instrument.errors import InputError
from tests.sealing import reseal
from vbaa_bench.dataset.readers import open_truth
from vbaa_bench.report import calibration, figures
from vbaa_bench.report.charts import svg
from vbaa_bench.report.report import report
from vbaa_bench.scoring.layout import Results
from vbaa_bench.scoring.score import score


def test_psi_and_stated_errors_are_shown_where_a_method_answers_them(
    dataset: Path, tmp_path: Path
) -> None:
    shutil.copytree(dataset, tmp_path / "small")
    results = Results(tmp_path / "small")
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
    for absent in ("psi RMSE", "Stated errors", "Inclination and stiffness", "false contact"):
        assert absent not in page
    score(results, {name: tmp_path / f"{name}.csv" for name in ("plain", "more")})
    page = report(results).read_text(encoding="utf-8")
    assert "points of the profile fit" in page
    for title in ("psi RMSE", "1/k_s, rigid", "Error of psi", "Stated errors of contact distance"):
        assert title in page
    # No spring, so no chart of compliance; psi's and x_c's stated errors; Fig. 8 and errors.
    assert page.count("<svg") == 1 + 1 + 2 + 2 * 2 + 2
    table = results.scores / "scores.parquet"
    pl.read_parquet(table).drop("consistent").write_parquet(table)
    with pytest.raises(InputError, match="score the dataset again"):
        report(results)


def test_charts_of_many_frames_stay_small() -> None:
    count = 6000  # beyond altair's limit of 5,000 rows
    random = np.random.default_rng(0)
    scores = pl.DataFrame(
        {
            "method": "exact_fit",
            "failed": False,
            "push": "10 %",
            "deflection_pct": 10.0,
            "pushing_angle_deg": 5.0,
            "true_x_c_mm": random.uniform(80, 200, count),
            "true_force_n": random.uniform(0.1, 1, count),
            "x_c_mm": random.uniform(80, 200, count),
            "x_c_error_pct_L": random.normal(size=count),
            "force_n": random.uniform(0.1, 1, count),
            "true_psi_deg": random.uniform(-30, 30, count),
            "psi_error_deg": random.normal(size=count),
            "k_s_n_m": 1.0,
            "true_compliance_mm_per_n": random.uniform(1, 2, count),
            "compliance_error_pct": random.normal(size=count),
        }
    )
    charts = [
        figures.error_against_distance(scores, "exact_fit"),
        figures.fig8_contact_distance(scores, "exact_fit"),
        figures.fig8_force(scores, "exact_fit", 240, 4000),
        *calibration.further_errors(scores, {"exact_fit": "red"}),
    ]
    assert len(charts) == 5
    for chart in charts:
        assert 1e5 < len(svg(chart)) < 5e5
    shown = figures.sample_dots(scores)
    assert shown.height == figures.MAX_DOTS
    assert shown.equals(figures.sample_dots(scores))


def test_a_report_is_written_where_the_solver_cannot_be_set_up(
    dataset: Path, tmp_path: Path
) -> None:
    shutil.copytree(dataset, tmp_path / "small")
    results = Results(tmp_path / "small")
    true = open_truth(results.dataset.truth).frames
    true.select("frame_id", "x_c_mm").write_csv(tmp_path / "plain.csv")
    score(results, {"plain": tmp_path / "plain.csv"})
    shutil.rmtree(results.dataset.observations / "rest")
    with pytest.raises(InputError, match=r"rest_00\.png: is missing; run the command"):
        report(results)
    reseal(results.dataset)
    page = report(results).read_text(encoding="utf-8")
    assert "the solver cannot be set up" in page
    assert "points of the profile fit" not in page
