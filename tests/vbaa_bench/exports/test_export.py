"""An export is whole or absent: interruption, damage, and the check of what was written."""

import errno
import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

from solver.instrument.errors import DamageError, InputError
from solver.instrument.files import sha256
from tests.sealing import reseal
from tests.vbaa_bench.exports.test_formats import SMALL_FILE, exported
from tests.vbaa_bench.exports.written import Size, write_dataset
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.exports import lerobot
from vbaa_bench.exports.check import same_value
from vbaa_bench.exports.flat_csv import FlatCsv
from vbaa_bench.exports.format import FORMATS, find_format
from vbaa_bench.exports.hugging_face import HuggingFace
from vbaa_bench.exports.lerobot_stats import combined, value_stats
from vbaa_bench.exports.output import Record
from vbaa_bench.exports.parts import Part
from vbaa_bench.exports.source import Source, open_source
from vbaa_bench.exports.web_dataset import WebDataset


@pytest.fixture
def data(tmp_path: Path) -> Path:
    return write_dataset(tmp_path / "data")


def contents(root: Path) -> dict[str, str]:
    files = (path for path in root.rglob("*") if path.is_file())
    return {path.relative_to(root).as_posix(): sha256(path) for path in files}


@pytest.mark.thorough
@pytest.mark.parametrize("name", FORMATS)
def test_an_interrupted_export_continues_to_the_same_bytes(
    tmp_path: Path, data: Path, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = exported(data, name, tmp_path / "whole", most_bytes=SMALL_FILE)
    chosen, written = find_format(name), list[int]()
    write_part = chosen.write_part
    monkeypatch.setattr(chosen, "usual_cut", chosen.usual_cut)
    if name == "csv":  # it cuts by the number of frames
        monkeypatch.setattr(chosen, "usual_cut", type(chosen.usual_cut)(10**9, 2))
        whole = exported(data, name, tmp_path / "pairs")

    def interrupted(self: Any, folder: Path, part: Part) -> Record:
        written.append(part.index)
        if len(written) == 3:
            raise KeyboardInterrupt
        return write_part(self, folder, part)

    monkeypatch.setattr(chosen, "write_part", interrupted)
    most_bytes = None if name == "csv" else SMALL_FILE
    with pytest.raises(KeyboardInterrupt):
        exported(data, name, tmp_path / "out", most_bytes=most_bytes)
    assert not (tmp_path / "out").exists()
    exported(data, name, tmp_path / "out", most_bytes=most_bytes)
    assert written[:4] == [0, 1, 2, 2]  # the first two parts were kept
    assert contents(tmp_path / "out") == contents(whole)


def test_other_options_or_data_begin_again(
    tmp_path: Path, data: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    finish = WebDataset.finish

    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(WebDataset, "finish", interrupted)
    with pytest.raises(KeyboardInterrupt):
        exported(data, "webdataset", tmp_path / "out")
    monkeypatch.setattr(WebDataset, "finish", finish)
    out = exported(data, "webdataset", tmp_path / "out", centrelines=True, most_bytes=SMALL_FILE)
    table = json.loads((out / "index.json").read_bytes())
    assert len(list(out.glob("*.tar"))) == len(table["shardlist"])


def test_damage_of_the_dataset_is_found_and_nothing_appears(tmp_path: Path, data: Path) -> None:
    image = next(data.glob("observations/shard_*/*.png"))
    original = image.read_bytes()
    image.write_bytes(original[:-1] + b"x")
    with pytest.raises(DamageError, match=f"{image.name}: is not what was generated"):
        exported(data, "hf", tmp_path / "out")
    image.unlink()
    with pytest.raises(DamageError, match=f"{image.name}: is missing"):
        exported(data, "csv", tmp_path / "out")
    assert not (tmp_path / "out").exists()
    image.write_bytes(original)
    exported(data, "csv", tmp_path / "out")


def test_a_frame_that_the_hashes_do_not_list_is_refused(tmp_path: Path, data: Path) -> None:
    (shard, *_) = sorted(data.glob("observations/shard_*"))
    (image, *_) = shard.glob("*.png")
    table = json.loads((shard / "hashes.json").read_bytes())
    del table[image.name]
    (shard / "hashes.json").write_text(json.dumps(table), encoding="utf-8")
    (data / "observations" / "hashes.json").unlink()
    reseal_tree(data)
    with pytest.raises(InputError, match="does not list the image of the frame"):
        exported(data, "hf", tmp_path / "out")


def reseal_tree(root: Path) -> None:
    """Record the shards' tables as they are now in the tree's."""
    tree = Layout(root).observations
    files = [*tree.glob("*/hashes.json"), *tree.glob("rest/*"), *tree.glob("calibration/*")]
    table = {path.relative_to(tree).as_posix(): sha256(path) for path in files}
    table["rig.json"] = sha256(tree / "rig.json")
    (tree / "hashes.json").write_text(json.dumps(table), encoding="utf-8")


def test_the_truth_is_migrated_and_its_types_are_checked(tmp_path: Path, data: Path) -> None:
    # The manifest states no version: it is of the first, whose truth has no `processor`.
    assert open_source(data).schema.types["processor"] == pl.String
    path = next(data.glob("truth/shard_*/truth.parquet"))
    pl.read_parquet(path).with_columns(x_c_mm=pl.lit("x")).write_parquet(path)
    reseal(Layout(data))
    message = r"truth\.parquet: x_c_mm holds String, allowed are numbers"
    with pytest.raises(InputError, match=message):
        exported(data, "hf", tmp_path / "out")


def test_types_of_a_column_are_merged_or_refused(tmp_path: Path, data: Path) -> None:
    first, second, *_ = sorted(data.glob("truth/shard_*/truth.parquet"))
    for other, merged in ((pl.lit(2.5), pl.Float64), (pl.lit("x"), pl.String)):
        for path, value in ((first, pl.lit(1)), (second, other)):
            pl.read_parquet(path).with_columns(value.alias("drawn.x")).write_parquet(path)
        reseal(Layout(data))
        assert open_source(data).schema.types["drawn.x"] == merged
    several = pl.read_parquet(first).with_columns(pl.concat_list(pl.lit(1.0)).alias("drawn.x"))
    several.write_parquet(first)
    pl.read_parquet(second).with_columns(pl.lit(2.5).alias("drawn.x")).write_parquet(second)
    reseal(Layout(data))
    with pytest.raises(InputError, match=r"data: a column has several types \("):
        exported(data, "csv", tmp_path / "out")


def test_a_frame_in_two_shards_is_refused(tmp_path: Path, data: Path) -> None:
    for tree in Layout(data).trees:
        shutil.copytree(tree / "shard_00000", tree / "shard_00009")
    reseal(Layout(data))
    with pytest.raises(InputError, match=r"data: the frame '[0-9a-f]+' is in two shards"):
        exported(data, "csv", tmp_path / "out")


def test_frames_that_failed_are_left_out(tmp_path: Path) -> None:
    root = write_dataset(tmp_path / "data", Size(per_shard=1))
    shard = "shard_00004"
    metadata = root / "observations" / shard / "metadata.csv"
    head, row = metadata.read_text(encoding="utf-8").splitlines()
    frame_id = row.split(",")[1]
    metadata.write_text(f"{head}\n", encoding="utf-8")
    (metadata.parent / f"{frame_id}.png").unlink()
    truth = root / "truth" / shard / "truth.parquet"
    pl.read_parquet(truth).clear().write_parquet(truth)
    failures = root / "truth" / shard / "failures.json"
    failures.write_text(json.dumps({frame_id: "no equilibrium"}), encoding="utf-8")
    reseal(Layout(root))
    for name in FORMATS:
        out = exported(root, name, tmp_path / name)
        assert "8 frames of one rig" in (out / "README.md").read_text(encoding="utf-8")


def test_a_full_disk_is_one_sentence_and_the_export_continues(
    tmp_path: Path, data: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("vbaa_bench.exports.parquet.write_bytes", full)
    with pytest.raises(InputError, match=r"out: cannot be written \(No space left on device\)"):
        exported(data, "hf", tmp_path / "out")
    assert not (tmp_path / "out").exists()
    monkeypatch.undo()
    exported(data, "hf", tmp_path / "out")


def test_names_that_leave_the_folder_and_missing_keys_are_not_used(
    tmp_path: Path, data: Path
) -> None:
    (tmp_path / "secret.txt").write_text("secret", encoding="utf-8")
    table = json.loads((data / "observations" / "hashes.json").read_bytes())
    table["../../secret.txt"] = sha256(tmp_path / "secret.txt")
    (data / "observations" / "hashes.json").write_text(json.dumps(table), encoding="utf-8")
    with pytest.raises(DamageError, match="names of files in this folder"):
        exported(data, "csv", tmp_path / "deep" / "er" / "out")
    assert "secret.txt" not in {path.name for path in (tmp_path / "deep").rglob("*")}
    manifest = json.loads((data / "truth" / "manifest.json").read_bytes())
    del manifest["true_rig"]["camera"]
    (data / "truth" / "manifest.json").write_text(json.dumps(manifest), encoding="utf-8")
    reseal(Layout(data))
    with pytest.raises(
        InputError, match=r"manifest\.json: the key true_rig\.camera\.fx_px is missing"
    ):
        exported(data, "lerobot", tmp_path / "out")


def test_a_folder_that_exists_is_not_touched(tmp_path: Path, data: Path) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "mine.txt").write_text("mine", encoding="utf-8")
    with pytest.raises(InputError, match="exists already"):
        exported(data, "csv", tmp_path / "out")
    assert contents(tmp_path / "out").keys() == {"mine.txt"}
    (tmp_path / "empty").mkdir()
    assert exported(data, "csv", tmp_path / "empty").is_dir()


def _swapped(self: Any, folder: Path, part: Part) -> Any:
    """Write a part whose first two frames have each other's images."""
    images = part.table["frame_id"].to_list()
    images[0], images[1] = images[1], images[0]
    shards = part.table["shard"].to_list()
    shards[0], shards[1] = shards[1], shards[0]
    places = iter(zip(shards, images, strict=True))

    class Swapped(Part):
        def frames(self) -> Any:
            for frame in super().frames():
                shard, name = next(places)
                yield frame._replace(png=frame.rig.image_path(shard, name).read_bytes())

    return _WRITE[type(self)](self, folder, Swapped(**vars(part)))


_WRITE: dict[type, Any] = {kind: kind.write_part for kind in map(find_format, FORMATS)}


@pytest.mark.parametrize("name", FORMATS)
def test_swapped_images_are_named(
    tmp_path: Path, data: Path, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(find_format(name), "write_part", _swapped)
    with pytest.raises(DamageError, match=r"out: is not what was exported: the image of the frame"):
        exported(data, name, tmp_path / "out")
    assert not (tmp_path / "out").exists()
    monkeypatch.undo()
    exported(data, name, tmp_path / "out")  # nothing of the bad export is kept


@pytest.mark.parametrize("kind", [HuggingFace, FlatCsv, WebDataset])
def test_changed_labels_and_missing_frames_are_named(
    tmp_path: Path, data: Path, kind: type[Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    read_back = kind.read_back

    def changed(self: Any, folder: Path, source: Source) -> Any:
        for i, frame in enumerate(read_back(self, folder, source)):
            if i == 2:
                yield frame._replace(values={**frame.values, "x_c_mm": 7.25})
            elif i != 8:
                yield frame

    monkeypatch.setattr(kind, "read_back", changed)
    name = next(key for key in FORMATS if find_format(key) is kind)
    with pytest.raises(DamageError) as caught:
        exported(data, name, tmp_path / "out")
    assert "x_c_mm of the frame" in str(caught.value)
    assert "is missing" in str(caught.value)
    assert "{'train': 8} frames by split" in str(caught.value)


@pytest.mark.parametrize(
    ("value", "expected", "same"),
    [
        (None, None, True),
        (float("nan"), None, True),
        ([float("nan")] * 3, None, True),
        ("", None, True),
        ("text", None, False),
        (0.0, None, False),
        ([], None, False),
        (None, 0.1, False),
        (np.float32(0.1), 0.1, True),
        (0.1000001, 0.1, False),
        ([1.0], [1.0, 2.0], False),
        ([1.0, 2.0], [1.0, 2.0], True),
    ],
)
def test_values_are_compared(value: Any, expected: Any, same: bool) -> None:
    assert same_value(value, expected) == same


def test_shifted_offsets_are_named(
    tmp_path: Path, data: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    episodes = lerobot._episodes

    def shifted(part: Part, *arguments: Any) -> pl.DataFrame:
        table = episodes(part, *arguments)
        offset = pl.lit(part.first_frame)  # counts from 0 in every file, as in lerobot #2438
        return table.with_columns(pl.col("dataset_from_index", "dataset_to_index") - offset)

    monkeypatch.setattr(lerobot, "_episodes", shifted)
    with pytest.raises(DamageError, match="offsets are not those of the frames"):
        exported(data, "lerobot", tmp_path / "out", most_bytes=SMALL_FILE)


def test_statistics_of_parts_combine_to_those_of_all(random: np.random.Generator) -> None:
    parts = [random.normal(size=(n, 2)) for n in (1, 4, 7)]
    parts[1][2] = np.nan
    stats = combined([value_stats(part) for part in parts])
    values = np.concatenate(parts)
    values = values[~np.isnan(values).any(axis=1)]
    np.testing.assert_allclose(stats["mean"], values.mean(axis=0))
    np.testing.assert_allclose(stats["std"], values.std(axis=0))
    np.testing.assert_array_equal(stats["min"], values.min(axis=0))
    assert stats["count"] == [11]
    nothing = combined([value_stats(np.full((3, 1), np.nan))])
    assert nothing["count"] == [0]
    assert np.isfinite(nothing["mean"]).all()


def test_a_format_may_have_no_images(
    tmp_path: Path, data: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    kind = find_format("csv")
    read_back = kind.read_back
    monkeypatch.setattr(
        kind,
        "read_back",
        lambda *args: (frame._replace(image=None) for frame in read_back(*args)),
    )
    assert (exported(data, "csv", tmp_path / "out") / "metadata.csv").is_file()
