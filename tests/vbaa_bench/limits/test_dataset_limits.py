"""Limits of a dataset: one row per frame and information set, of any number of processes."""

import shutil
from pathlib import Path

import polars as pl
import pytest

from solver.instrument.errors import DamageError
from vbaa_bench.dataset.derived import read_limits
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.dataset.readers import open_truth
from vbaa_bench.limits.dataset_limits import dataset_limits
from vbaa_bench.limits.table import SCHEMA
from vbaa_bench.scoring.score_columns import LIMITS


def test_limits_are_stored_beside_the_truth_and_belong_to_it(
    dataset: Path, variant: str, tmp_path: Path
) -> None:
    root = tmp_path / "small"
    shutil.copytree(dataset, root)
    done: list[tuple[int, int]] = []
    table = dataset_limits(root, variant, 1, lambda *count: done.append(count))
    assert done[-1] == (2, 2)
    assert dict(table.schema) == SCHEMA
    assert list(SCHEMA) == list(LIMITS)
    frames = open_truth(root / "truth").frames
    sets = {"planar", "image", "push"}
    assert set(table.select("frame_id", "information").iter_rows()) == {
        (frame, name) for frame in frames["frame_id"] for name in sets
    }
    image = table.filter(pl.col("information") == "image").join(frames, on="frame_id")
    # Between 0.003 and 0.03 % of the length. The rigidity is the nominal one: its tolerance of 1 %
    # does not add to the force's error.
    assert image["x_c_limit_mm"].is_between(0.0072, 0.072).all()
    assert (image["force_limit_n"] / image["force_n"]).is_between(0.0001, 0.002).all()
    deeper = image.sort("contact_distance_at_rest_mm", "step")["x_c_limit_mm"].to_list()
    assert deeper[1] < deeper[0]
    assert deeper[3] < deeper[2]
    stored = read_limits(Layout(root))
    assert stored is not None
    assert stored.equals(table.sort("frame_id", "information"))
    hashes = root / "truth" / "hashes.json"
    hashes.write_text(hashes.read_text() + "\n")
    with pytest.raises(DamageError, match="from another truth"):
        read_limits(Layout(root))
