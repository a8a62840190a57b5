"""Which frames of a dataset count."""

from pathlib import Path

import polars as pl
import pytest

from solver.instrument.errors import InputError
from tests.vbaa_bench.exports.written import Size, write_collection, write_dataset
from vbaa_bench.dataset.collection import rigs_of
from vbaa_bench.suite.folder import frames_of
from vbaa_bench.suite.leaderboard import rows_of_split


def test_only_the_frames_of_the_split_count(tmp_path: Path) -> None:
    root = write_collection(tmp_path / "rigs", [Size(), Size()])
    rows = pl.concat(
        frames_of(layout).with_columns(rig=pl.lit(number, pl.Int32))
        for number, layout in enumerate(rigs_of(root))
    )
    assert set(rows["split"]) == {"train", "test"}
    assert rows_of_split(rows, root, "test").equals(rows.filter(pl.col("split") == "test"))
    one = write_dataset(tmp_path / "one", splits=["train", "test"])
    of_one = frames_of(*rigs_of(one))
    assert set(rows_of_split(of_one, one, "train")["split"]) == {"train"}
    with pytest.raises(
        InputError, match="the split 'learn' does not exist, allowed is test, train"
    ):
        rows_of_split(of_one, one, "learn")
