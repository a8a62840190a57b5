"""A dataset with predictions of two methods: one states its covariance, the other does not."""

import shutil
from pathlib import Path

import polars as pl
import pytest

from vbaa_bench.dataset.readers import open_truth
from vbaa_bench.viewer.frames import ViewedDataset, open_frames


@pytest.fixture(scope="session")
def predicted(dataset: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("viewed") / "small"
    shutil.copytree(dataset, root)
    truth = open_truth(root / "truth", centrelines=False).frames.sort("trial")
    estimates = truth.select(
        "frame_id",
        outcome=pl.lit("contact"),
        x_c_mm=pl.col("x_c_mm") + 0.05,
        x_c_sigma_mm=pl.lit(0.04),
        y_c_mm=pl.col("y_c_mm"),
        y_c_sigma_mm=pl.lit(0.02),
        force_n=pl.col("force_n") * 1.01,
        force_sigma_n=pl.col("force_n") * 0.01,
        x_c_force_correlation=pl.lit(-0.8),
        x_c_y_c_correlation=pl.lit(0.6),
    )
    (root / "predictions").mkdir()
    estimates.write_csv(root / "predictions" / "exact_fit.csv")
    # A user's own table, without sigmas, and without an estimate in the last frame.
    own = estimates.select("frame_id", x_c_mm=pl.col("x_c_mm") - 2).head(3)
    own.write_csv(root / "predictions" / "mine.csv")
    return root


@pytest.fixture
def viewed(predicted: Path) -> ViewedDataset:
    return open_frames(predicted, slice(None))
