"""A large dataset is one that scoring and reporting accept, and what they take is measured."""

from pathlib import Path

import polars as pl
import pytest

from results.score_speed.enlarged import enlarge
from results.score_speed.measure import measure
from solver.instrument.errors import InputError
from vbaa_bench.dataset.copies import copy_tree
from vbaa_bench.dataset.derived import read_limits, write_limits
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.dataset.readers import open_truth
from vbaa_bench.scoring.results_layout import Results
from vbaa_bench.scoring.score_columns import LIMITS


@pytest.fixture
def solved(dataset: Path, tmp_path: Path) -> Results:
    """A dataset of 4 frames with predictions of two methods, and limits."""
    results = Results(tmp_path / "small")
    for tree, copied in zip(Layout(dataset).trees, results.dataset.trees, strict=True):
        copy_tree(tree, copied)
        (copied / "hashes.json").write_bytes((tree / "hashes.json").read_bytes())
    true = open_truth(results.dataset.truth).frames
    results.predictions.mkdir()
    for name, error in (("near", 0.1), ("far", 1.0)):
        table = true.select("frame_id", x_c_mm=pl.col("x_c_mm") + error, psi_deg=pl.lit(None))
        table.write_csv(results.predictions / f"{name}.csv")
    bounds = true.select("frame_id", information=pl.lit("image"), x_c_limit_mm=pl.lit(0.1))
    empty = (pl.lit(None, pl.Float64).alias(name) for name in LIMITS.keys() - set(bounds.columns))
    write_limits(results.dataset, bounds.with_columns(empty))
    return results


def test_copies_have_other_names_pushes_and_estimates(solved: Results, tmp_path: Path) -> None:
    assert enlarge(solved.root, tmp_path / "large", 10, ["near"]) == ["near"]
    large = Results(tmp_path / "large")
    frames = open_truth(large.dataset.truth).frames
    assert frames.height == frames["frame_id"].n_unique() == 12
    small = open_truth(solved.dataset.truth).frames
    assert frames["push_id"].n_unique() == 3 * small["push_id"].n_unique()
    places = frames["contact_distance_at_rest_mm"]
    assert places.n_unique() > small["contact_distance_at_rest_mm"].n_unique()
    assert [path.name for path in large.predictions.iterdir()] == ["near.csv"]
    joined = frames.join(pl.read_csv(large.predictions / "near.csv"), on="frame_id", suffix="_est")
    errors = (joined["x_c_mm_est"] - joined["x_c_mm"]).to_numpy()
    assert errors == pytest.approx(0.1, abs=0.1)
    assert len(set(errors)) == joined["x_c_mm"].drop_nulls().len()
    limits = read_limits(large.dataset)
    assert limits is not None
    assert set(limits["frame_id"]) == set(frames["frame_id"])
    with pytest.raises(InputError, match="holds no predictions of mine"):
        enlarge(solved.root, tmp_path / "other", 10, ["near", "mine"])


def test_scoring_and_reporting_are_measured(solved: Results) -> None:
    record = measure(solved.root, 8)
    assert record["methods"] == ["far", "near"]
    for stage in ("score", "report"):
        assert record[stage]["seconds"] > 0
        assert record[stage]["processor_s"] > 0
        assert 0.05 < record[stage]["peak_gb"] < 4
    assert [path.name for path in solved.root.parent.iterdir()] == ["small"]
