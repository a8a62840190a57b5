"""Which frames and datasets count."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from solver.instrument.errors import InputError
from tests.vbaa_bench.exports.written import Size, write_collection, write_dataset
from vbaa_bench.dataset.collection import rigs_of
from vbaa_bench.scoring.bootstrap import draws
from vbaa_bench.suite.figures import ERROR
from vbaa_bench.suite.folder import frames_of
from vbaa_bench.suite.leaderboard import _figure, _Scored, rows_of_split


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


def dataset(errors: Sequence[float | None], *, right: bool = False) -> _Scored:
    """Four contacts of a method, None for a refusal, which is `right` or not."""
    rows = pl.DataFrame({"method": "mine", "x_c_error_pct_L": pl.Series(errors, dtype=pl.Float64)})
    refused = pl.col("x_c_error_pct_L").is_null()
    rows = rows.with_columns(free=False, failed=refused, rightly_refused=refused & pl.lit(right))
    return _Scored(rows, np.arange(4), draws(4, size=3, seed=1))


def test_right_refusals_do_not_count_and_others_are_half_of_the_length() -> None:
    answered, refused = dataset([0.02, -0.02, 0.02, 0.02]), [None] * 4
    alone, _ = _figure(ERROR, "mine", [answered])
    rightly, _ = _figure(ERROR, "mine", [answered, dataset(refused, right=True)])
    wrongly, _ = _figure(ERROR, "mine", [answered, dataset(refused)])
    assert alone.value == rightly.value == pytest.approx(0.02)
    assert wrongly.value == pytest.approx((0.02 * 50) ** 0.5)
    never, _ = _figure(ERROR, "mine", [dataset(refused), dataset(refused, right=True)])
    assert never.value is None
