"""Splits of a table of frames."""

from pathlib import Path

import polars as pl
import pytest

from solver.instrument.errors import InputError
from vbaa_bench.dataset.splits import ONLY, check_split, split_names


def test_the_split_is_that_of_the_table() -> None:
    frames = pl.DataFrame({"frame_id": ["a", "b", "c"], "split": ["test", "train", None]})
    assert split_names(frames).to_list() == ["test", "train", ONLY]
    # A rig whose splits have names like numbers.
    assert split_names(pl.DataFrame({"split": [0, 1]})).to_list() == ["0", "1"]


def test_without_splits_all_frames_are_for_training() -> None:
    names = split_names(pl.DataFrame({"frame_id": ["a", "b"]}))
    assert names.name == "split"
    assert names.to_list() == [ONLY, ONLY] == ["train", "train"]
    empty = split_names(pl.DataFrame({"frame_id": []}))
    assert empty.dtype == pl.String
    assert empty.is_empty()


def test_a_split_that_does_not_exist_is_refused() -> None:
    check_split("test", {"train", "test"}, Path("runs/x"))
    with pytest.raises(InputError) as refused:
        check_split("val", {"train", "test"}, Path("runs/x"))
    assert str(refused.value) == ("runs/x: the split 'val' does not exist, allowed is test, train")
