"""The client libraries read the exports, where they are installed."""

import io
from pathlib import Path

import numpy as np
import pytest

from tests.vbaa_bench.exports.test_formats import SMALL_FILE, exported, image_of
from tests.vbaa_bench.exports.written import Size, write_dataset
from vbaa_bench.exports.croissant import write_croissant

DEEP = Size(bits=16)
# The libraries have warnings of their own.
pytestmark = pytest.mark.filterwarnings("ignore")


def test_datasets_loads_images_of_16_bits(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HF_HUB_OFFLINE", "1")
    monkeypatch.setenv("HF_HOME", str(tmp_path / "home"))
    datasets = pytest.importorskip("datasets")
    root = write_dataset(tmp_path / "data", DEEP, splits=["train", "test"])
    out = exported(root, "hf", tmp_path / "out", most_bytes=SMALL_FILE)
    loaded = datasets.load_dataset(str(out))
    assert {name: len(rows) for name, rows in loaded.items()} == {"train": 6, "test": 3}
    row = loaded["test"][0]
    np.testing.assert_array_equal(np.array(row["image"]), image_of(root, row["frame_id"]))


def test_webdataset_pairs_images_with_labels(tmp_path: Path) -> None:
    webdataset = pytest.importorskip("webdataset")
    image_module = pytest.importorskip("PIL.Image")
    root = write_dataset(tmp_path / "data", DEEP)
    out = exported(root, "webdataset", tmp_path / "out")
    frames = list(webdataset.WebDataset(str(out / "train-000000.tar"), shardshuffle=False).decode())
    assert len(frames) == 9
    image = np.array(image_module.open(io.BytesIO(frames[3]["png"])))
    np.testing.assert_array_equal(image, image_of(root, frames[3]["json"]["frame_id"]))


def test_lerobot_loads_every_episode(tmp_path: Path) -> None:
    lerobot = pytest.importorskip("lerobot.datasets.lerobot_dataset")
    root = write_dataset(tmp_path / "data")
    out = exported(root, "lerobot", tmp_path / "out", most_bytes=SMALL_FILE)
    data = lerobot.LeRobotDataset("vbaa_bench/export", root=out)
    assert [int(data[i]["episode_index"]) for i in range(9)] == [0, 0, 0, 1, 1, 1, 2, 2, 2]


def test_mlcroissant_finds_no_error(tmp_path: Path) -> None:
    mlcroissant = pytest.importorskip("mlcroissant")
    root = write_dataset(tmp_path / "data", splits=["train", "test"])
    data = mlcroissant.Dataset(write_croissant(root))
    assert not data.metadata.ctx.issues.errors
    assert len(list(data.records("frames"))) == 9
