"""Splits of a table of frames."""

from pathlib import Path

import polars as pl
import pytest

from solver.instrument.errors import InputError
from tests.vbaa_bench.stored import store
from vbaa_bench.dataset.info import dataset_info
from vbaa_bench.dataset.layout import METADATA, Layout
from vbaa_bench.dataset.splits import ONLY, check_split, read_splits, split_names
from vbaa_bench.dataset.subset import Choice, subset


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


def test_the_splits_of_a_shard_are_those_of_its_readings(tmp_path: Path) -> None:
    layout = Layout(store(tmp_path / "set", frames=3, splits=("train", "test"), per_shard=2))
    assert dict(read_splits(layout, 0).iter_rows()) == {"0000": "train", "0007": "test"}
    assert dict(read_splits(layout, 1).iter_rows()) == {"0014": "train"}
    assert dataset_info(layout.root).splits == {"train": 2, "test": 1}
    assert subset(layout.root, tmp_path / "small", Choice(split="test")) == 1
    free = tmp_path / "free" / "observations" / "shard_00000" / METADATA
    free.parent.mkdir(parents=True)
    free.write_text("file_name\n0.png\n")
    with pytest.raises(InputError, match=r"metadata\.csv: cannot be read \(.*frame_id"):
        read_splits(Layout(tmp_path / "free"), 0)
