"""Every format: all frames arrive, in their splits, with their pixels and values."""

import json
import re
import tarfile
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import polars as pl
import pytest
from ruamel.yaml import YAML

from solver.instrument.errors import InputError
from solver.instrument.images import read_grey
from tests.sealing import reseal
from tests.vbaa_bench.exports.written import Size, write_collection, write_dataset
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.exports.export import export
from vbaa_bench.exports.format import FORMATS
from vbaa_bench.exports.source import open_source

DEEP = Size(bits=16)
SMALL_FILE = 700  # about two images of the small datasets


def exported(root: Path, name: str, out: Path, **options: Any) -> Path:
    return export(root, name, out, lambda *_: None, **options).folder


@pytest.fixture(scope="module")
def split_data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("split") / "data"
    return write_dataset(root, Size(pushes=5), splits=["train", "test"])


def image_of(root: Path, frame_id: str) -> Any:
    (path,) = root.glob(f"**/observations/*/{frame_id}.png")
    return read_grey(path)


@pytest.mark.thorough
@pytest.mark.parametrize("name", FORMATS)
@pytest.mark.parametrize("most_bytes", [None, SMALL_FILE])
def test_all_formats_export_splits_and_collections(
    tmp_path: Path, split_data: Path, name: str, most_bytes: int | None
) -> None:
    result = export(split_data, name, tmp_path / "out", lambda *_: None, most_bytes=most_bytes)
    assert result.splits == {"train": 9, "test": 6}
    rigs = write_collection(tmp_path / "rigs", [Size(), Size(pushes=2)])
    result = export(rigs, name, tmp_path / "both", lambda *_: None, most_bytes=most_bytes)
    assert result.splits == {"train": 9, "test": 6}
    readme = (tmp_path / "both" / "README.md").read_text(encoding="utf-8")
    assert "15 frames of 2 rigs" in readme
    assert "CC-BY-4.0" in readme
    assert (tmp_path / "both/rigs/rig_00001/calibration/view_00.png").is_file()
    assert not list(tmp_path.glob(".*.part"))


def test_hugging_face_files_have_images_labels_and_the_metadata_of_the_library(
    tmp_path: Path,
) -> None:
    root = write_dataset(tmp_path / "data", DEEP, splits=["train", "val"])
    out = exported(root, "hf", tmp_path / "out", most_bytes=SMALL_FILE, centrelines=True)
    files = sorted((out / "data").iterdir())
    for split in ("train", "val"):
        names = [path.name for path in files if path.name.startswith(split)]
        assert len(names) > 1
        assert names == [f"{split}-{i:05d}-of-{len(names):05d}.parquet" for i in range(len(names))]
    first = files[0]
    metadata = pl.read_parquet_metadata(first)
    assert "ARROW:schema" not in metadata  # pyarrow would not see the next key beside it
    features = json.loads(metadata["huggingface"])["info"]["features"]
    assert features["image"] == {"_type": "Image"}
    assert features["x_c_mm"] == {"dtype": "float64", "_type": "Value"}
    assert features["hidden_by"]["dtype"] == "string"  # null in all frames
    table = pl.concat([pl.read_parquet(path) for path in files])
    assert table.schema["k_s_n_m"] == pl.Float64  # null in all frames, too
    assert table["centreline_y_mm"].list.len().to_list() == [3] * 9
    for row in table.iter_rows(named=True):
        image = cv2.imdecode(np.frombuffer(row["image"]["bytes"], np.uint8), cv2.IMREAD_UNCHANGED)
        assert image is not None
        assert image.dtype == np.uint16
        np.testing.assert_array_equal(image, image_of(root, row["frame_id"]))
    front = (out / "README.md").read_text(encoding="utf-8").split("---")[1]
    assert "license: cc-by-4.0" in front
    assert '  - split: "val"\n    path: "data/val-*.parquet"' in front


def test_webdataset_names_belong_together(tmp_path: Path, split_data: Path) -> None:
    out = exported(split_data, "webdataset", tmp_path / "out", most_bytes=SMALL_FILE)
    index = json.loads((out / "index.json").read_bytes())
    assert sum(shard["nsamples"] for shard in index["shardlist"]) == 15
    with tarfile.open(out / "train-000000.tar") as tar:
        names = tar.getnames()
    assert [Path(name).suffix for name in names] == [".png", ".json"] * (len(names) // 2)
    assert [Path(name).stem for name in names[::2]] == [Path(name).stem for name in names[1::2]]
    again = exported(split_data, "webdataset", tmp_path / "again", most_bytes=SMALL_FILE)
    for path in out.glob("*.tar"):
        assert path.read_bytes() == (again / path.name).read_bytes()


def test_lerobot_offsets_hold_over_all_files(tmp_path: Path, split_data: Path) -> None:
    out = exported(split_data, "lerobot", tmp_path / "out", most_bytes=SMALL_FILE)
    info = json.loads((out / "meta" / "info.json").read_bytes())
    assert info["splits"] == {"train": "0:3", "test": "3:5"}
    assert info["features"]["observation.image"]["shape"] == [10, 24, 3]
    assert info["features"]["observation.state"]["names"] == ["motor_angle_deg", "moment_y_n_mm"]
    files = sorted(out.glob("data/*/*.parquet"))
    assert len(files) == 5  # no push is cut
    frames = pl.concat([pl.read_parquet(file) for file in files])
    assert frames["index"].to_list() == list(range(15))
    assert frames["step"].to_list() == [0, 1, 2] * 5
    assert frames["push_id"].rle_id().max() == 4
    episodes = pl.concat([pl.read_parquet(file) for file in sorted(out.glob("meta/episodes/*/*"))])
    assert episodes["dataset_from_index"].to_list() == [0, 3, 6, 9, 12]
    assert episodes["dataset_to_index"].to_list() == [3, 6, 9, 12, 15]
    assert episodes["data/file_index"].to_list() == [0, 1, 2, 3, 4]
    assert frames["truth.x_c_mm"].is_nan().sum() == 1  # the free frame
    stats = json.loads((out / "meta" / "stats.json").read_bytes())
    assert stats["truth.x_c_mm"]["count"] == [14]
    x_c = frames["truth.x_c_mm"].drop_nans()
    assert stats["truth.x_c_mm"]["mean"] == pytest.approx([x_c.mean()])
    assert stats["truth.x_c_mm"]["std"] == pytest.approx([x_c.std(ddof=0)])
    images = np.stack([image_of(split_data, name) for name in frames["frame_id"]]) / 255
    assert np.array(stats["observation.image"]["mean"]) == pytest.approx(
        np.full((3, 1, 1), images.mean())
    )
    assert np.array(stats["observation.image"]["std"]) == pytest.approx(
        np.full((3, 1, 1), images.std())
    )


def test_lerobot_takes_the_true_angle_where_there_is_no_encoder(tmp_path: Path) -> None:
    root = write_dataset(tmp_path / "data", mount="world")
    out = exported(root, "lerobot", tmp_path / "out")
    info = json.loads((out / "meta" / "info.json").read_bytes())
    assert info["features"]["action"]["names"] == ["true_motor_angle_deg"]
    assert info["features"]["observation.state"]["names"] == ["moment_y_n_mm"]


def test_csv_is_flat(tmp_path: Path) -> None:
    root = write_dataset(tmp_path / "data")
    out = exported(root, "csv", tmp_path / "out")
    table = pl.read_csv(out / "metadata.csv")
    assert table.height == 9
    assert {"force_antenna_n_x", "force_antenna_n_z", "hidden_stretches_mm"} <= set(table.columns)
    source = open_source(root)
    expected = dict(source.rows(source.index).select("frame_id", "x_c_mm").iter_rows())
    assert dict(table.select("frame_id", "x_c_mm").iter_rows()) == expected
    assert all((out / path).is_file() for path in table["file_name"])


@pytest.mark.thorough
def test_what_a_format_cannot_hold_is_refused_in_one_sentence(tmp_path: Path) -> None:
    deep = write_dataset(tmp_path / "deep", DEEP)
    with pytest.raises(InputError, match="its images have 16 bits, those of LeRobot 8"):
        exported(deep, "lerobot", tmp_path / "out")
    rigs = write_collection(tmp_path / "rigs", [Size(), Size(width=30)])
    with pytest.raises(InputError, match=r"images of 24 x 10 and 30 x 10 px"):
        exported(rigs, "lerobot", tmp_path / "out")
    flat = write_dataset(tmp_path / "flat", telecentric=True)
    with pytest.raises(InputError, match="leave out --centrelines"):
        exported(flat, "lerobot", tmp_path / "out", centrelines=True)
    odd = write_dataset(tmp_path / "odd", splits=["../train"])
    with pytest.raises(InputError, match=r"a split has the name '../train', allowed are letters"):
        exported(odd, "csv", tmp_path / "out")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["deep", "flat", "odd", "rigs"]
    for size, name in ((rigs, "hf"), (rigs, "webdataset"), (rigs, "csv")):
        exported(size, name, tmp_path / name)


def test_a_title_writes_neither_yaml_nor_markup(tmp_path: Path) -> None:
    root = write_dataset(tmp_path / "set")
    path = Layout(root).manifest
    document = json.loads(path.read_text())
    title = 'A "b" \\\n---\nlicense: mit\n---\n# <b>x</b>'
    document["scene"]["title"] = title
    path.write_text(json.dumps(document), encoding="utf-8")
    reseal(Layout(root))
    card = (exported(root, "hf", tmp_path / "out") / "README.md").read_text(encoding="utf-8")
    _, front, body = re.split("^---$", card, flags=re.MULTILINE)
    values = YAML(typ="safe").load(front)
    assert values["pretty_name"] == " ".join(title.split())
    assert values["license"] == "cc-by-4.0"
    assert values["configs"][0]["data_files"][0]["split"] == "train"
    assert "\n# A " in body
    assert "license: mit" not in [line.strip() for line in body.splitlines()]
    assert not re.search(r"(?<!\\)<b>", body)
