"""How the share of consistent frames depends on the thresholds of a right refusal."""

import shutil
from pathlib import Path

import polars as pl
import pytest

from results.random.__main__ import FACTORS, consistent_shares, varied
from vbaa_bench.scoring.refusals import THRESHOLDS, Thresholds


def test_one_threshold_or_all_are_multiplied() -> None:
    assert varied("edge_on_deg", 0.5) == THRESHOLDS._replace(edge_on_deg=7.5)
    assert varied("all", 2) == Thresholds(*(2 * one for one in THRESHOLDS))
    assert varied("all", 1) == THRESHOLDS


@pytest.mark.thorough
def test_answers_do_not_depend_on_the_thresholds_and_refusals_do(
    dataset: Path, tmp_path: Path
) -> None:
    root = shutil.copytree(dataset, tmp_path / "solved")
    frames = pl.concat(map(pl.read_parquet, root.rglob("truth.parquet")))
    (root / "predictions").mkdir(exist_ok=True)
    answered = frames.select(
        "frame_id", "x_c_mm", "force_n", x_c_sigma_mm=pl.lit(0.1), outcome=pl.lit("contact")
    )
    refused = frames.select(
        "frame_id", x_c_mm=pl.lit(None, pl.Float64), outcome=pl.lit("not identifiable")
    )
    for name, table in (("mine", answered), ("none", refused)):
        table.write_csv(root / "predictions" / f"{name}.csv")
    shares = consistent_shares([root], ["mine", "none"])
    columns = [f"x {factor:g}" for factor in FACTORS]
    assert set(shares.filter(method="mine")[columns].to_numpy().ravel()) == {100.0}
    (none,) = shares.filter(method="none", threshold="all")[columns].rows()
    assert none[0] == 0
    assert list(none) == sorted(none)  # a larger threshold excuses more
