"""A subset is a dataset of its own; parts that do not fit are not merged; facts are right."""

import json
import shutil
from pathlib import Path
from typing import Any

import polars as pl
import pytest
from typer.testing import CliRunner

import vbaa_bench as vb
from solver.instrument.errors import DamageError, InputError
from solver.instrument.hashes import HASHES
from solver.instrument.observation import open_observations
from tests.draws import scene_seed
from tests.sealing import reseal
from vbaa_bench import cli
from vbaa_bench.api.verification import verify
from vbaa_bench.cli.datasets import shard_range
from vbaa_bench.dataset.derived import read_limits, write_limits
from vbaa_bench.dataset.document import read_json
from vbaa_bench.dataset.identity import OtherDatasetError, check_identity, dataset_identity
from vbaa_bench.dataset.info import collection_info, dataset_info
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.dataset.merge import merge
from vbaa_bench.dataset.readers import open_truth
from vbaa_bench.dataset.subset import Choice, subset
from vbaa_bench.dataset.verify import Counts, faults
from vbaa_bench.scene.load import load_scene
from vbaa_bench.scoring.results_layout import Results
from vbaa_bench.scoring.score import score


@pytest.fixture
def source(dataset: Path, tmp_path: Path) -> Layout:
    """Four frames of two pushes in two shards; one frame of each push is in each shard."""
    layout = Layout(shutil.copytree(dataset, tmp_path / "source"))
    tables = [
        pl.read_parquet(layout.shard(layout.truth, number) / "truth.parquet") for number in range(2)
    ]
    for number, table in enumerate(tables):
        folder = layout.shard(layout.truth, number)
        pushes = pl.Series("push_id", ["a", "b"])
        table.with_columns(pushes).write_parquet(folder / "truth.parquet")
        readings = layout.shard(layout.observations, number) / "metadata.csv"
        splits = pl.Series("split", ["train", "test"])
        pl.read_csv(readings, infer_schema=False).with_columns(splits).write_csv(readings)
    reseal(layout)
    return layout


def ids(layout: Layout) -> list[str]:
    frames = open_truth(layout.truth).frames["frame_id"].to_list()
    observed = sorted(frame.frame_id for frame in open_observations(layout.observations).frames)
    assert frames == observed
    return [str(name) for name in frames]


@pytest.mark.parametrize(
    ("choice", "rows"),
    [
        (Choice(shards=(1, 2)), [(1, "a"), (1, "b")]),
        (Choice(split="test"), [(0, "b"), (1, "b")]),
        (Choice(frames=3), [(0, "a"), (1, "a")]),
        (Choice(frames=1), [(0, "a"), (1, "a")]),
        (Choice(frames=3, cut_pushes=True), [(0, "a"), (0, "b"), (1, "a")]),
        (Choice(frames=9), [(0, "a"), (0, "b"), (1, "a"), (1, "b")]),
    ],
)
def test_a_subset_has_the_chosen_frames(
    source: Layout, tmp_path: Path, choice: Choice, rows: list[tuple[int, str]]
) -> None:
    write_limits(source, open_truth(source.truth).frames.select("frame_id"))
    small = Layout(tmp_path / "small")
    assert subset(source.root, small.root, choice) == len(rows)
    expected = []
    for shard, push in rows:
        table = pl.read_parquet(source.shard(source.truth, shard) / "truth.parquet")
        expected += table.filter(push_id=push)["frame_id"].to_list()
    assert ids(small) == sorted(expected)
    assert verify(small.root).faults == []
    manifest = read_json(small.manifest)
    assert manifest["subset"]["frames"] == manifest["frames"] == len(rows)
    limits = read_limits(small)
    assert limits is not None
    assert sorted(limits["frame_id"]) == sorted(expected)


def test_a_subset_is_scored_and_not_grown(
    source: Layout, tmp_path: Path, small_scene: Path, variant: str
) -> None:
    small = tmp_path / "small"
    done = CliRunner().invoke(cli.app, ["subset", str(source.root), str(small), "--shards", "1"])
    assert done.stdout == f"2 frames in {small}\n"
    frames = open_truth(small / "truth").frames
    frames.select("frame_id", "x_c_mm").write_csv(tmp_path / "mine.csv")
    summary = score(Results(small), {"mine": tmp_path / "mine.csv"})
    assert summary["methods"]["mine"]["n"] == 2
    identity = dataset_identity(load_scene(small_scene), variant)
    with pytest.raises(OtherDatasetError, match="is a subset of another dataset"):
        check_identity(Layout(small), identity)
    with pytest.raises(InputError, match="is not empty"):
        subset(source.root, small, Choice(frames=1))


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({}, "allowed is one of frames, split and shards"),
        ({"frames": 3, "split": "train"}, "allowed is one of frames"),
        ({"split": "train", "cut_pushes": True}, "with frames only"),
    ],
)
def test_odd_choices_are_refused(tmp_path: Path, options: dict[str, Any], sentence: str) -> None:
    with pytest.raises(InputError, match=sentence):
        vb.subset(tmp_path, tmp_path / "few", **options)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [("a:b", "allowed is a number or a range"), ("3:3", "allowed is a range such as 0:10")],
)
def test_odd_shards_are_refused(text: str, sentence: str) -> None:
    with pytest.raises(InputError, match=sentence):
        shard_range(text)


def test_what_cannot_be_chosen_is_refused(source: Layout, tmp_path: Path) -> None:
    assert shard_range("7") == (7, 8)
    assert shard_range(":10") == (0, 10)
    with pytest.raises(InputError, match="has no such frames, there are 2 shards"):
        subset(source.root, tmp_path / "none", Choice(shards=(2, 9)))
    with pytest.raises(InputError, match="allowed is one of test, train"):
        subset(source.root, tmp_path / "none", Choice(split="val"))
    image = next(source.shard(source.observations, 0).glob("*.png"))
    image.write_bytes(b"damaged")
    with pytest.raises(DamageError, match=image.name):
        subset(source.root, tmp_path / "broken", Choice(frames=9))
    assert not (tmp_path / "broken" / "observations" / HASHES).exists()
    (source.truth / HASHES).unlink()
    with pytest.raises(InputError, match=r"is incomplete, hashes\.json is missing"):
        subset(source.root, tmp_path / "none", Choice(frames=9))


def parts(source: Layout, folder: Path) -> list[Path]:
    """The two shards of a dataset as two parts."""
    paths = []
    for number in range(2):
        part = Layout(shutil.copytree(source.root, folder / f"part {number}"))
        for tree in part.trees:
            shutil.rmtree(part.shard(tree, 1 - number))
        reseal(part)
        paths.append(part.root)
    return paths


def test_parts_that_do_not_fit_are_refused(
    dataset: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first, second = parts(Layout(dataset), tmp_path)
    out = tmp_path / "merged"
    with pytest.raises(InputError, match="both have shard_00000; merge each part once"):
        merge([first, first], out)
    with pytest.raises(InputError, match="the parts lack shard_00001; merge all parts"):
        merge([first], out)
    merge([first, second], out)
    assert verify(out).faults == []
    assert ids(Layout(out)) == ids(Layout(dataset))

    def torn(path: Path, target: Path) -> None:
        shutil.copytree(path, target, dirs_exist_ok=True)
        (target / HASHES).unlink()
        (target / "rig.json").write_bytes(b"")

    monkeypatch.setattr("vbaa_bench.dataset.merge.copy_tree", torn)
    with pytest.raises(DamageError, match="the copy is incomplete"):
        merge([first, second], tmp_path / "torn")
    assert not Layout(tmp_path / "torn").hashes.exists()
    document = read_json(Layout(second).manifest)
    del document["schema"]
    Layout(second).manifest.write_text(json.dumps(document))
    reseal(Layout(second))
    with pytest.raises(InputError, match="has version 1 of the format"):
        merge([first, second], tmp_path / "older")


def test_facts_are_those_of_the_files(source: Layout, tmp_path: Path) -> None:
    failures = {f"{number:016x}": "the beam would break" for number in range(9)}
    folder = source.shard(source.truth, 1)
    (folder / "failures.json").write_text(json.dumps(failures))
    reseal(source)
    write_limits(source, open_truth(source.truth).frames.select("frame_id"))
    facts = dataset_info(source.root)
    assert (facts.frames, facts.shards, facts.complete) == (4, 2, True)
    assert (facts.failed_frames, len(facts.failures)) == (9, 5)
    assert facts.splits == {"train": 2, "test": 2}
    assert facts.image == "512 x 176 px, 8 bits"
    assert (facts.seed, facts.title) == (scene_seed(11), "Four pushes for the tests")
    assert facts.derived == ["limits"]
    assert facts.solved == facts.scored == []
    done = CliRunner().invoke(cli.app, ["info", str(source.root)])
    assert "failed frames  9 (0000000000000000: the beam would break; " in done.stdout
    source.hashes.unlink()
    assert not dataset_info(source.root).complete
    with pytest.raises(InputError, match="is not a dataset"):
        dataset_info(tmp_path)


def test_facts_of_a_collection_are_sums(dataset: Path, tmp_path: Path) -> None:
    root = tmp_path / "rigs"
    for number in range(2):
        shutil.copytree(dataset, root / f"rig_{number:05d}")
    (root / "collection.json").write_text(json.dumps({"title": "Two rigs", "seed": 1, "rigs": 3}))
    (root / "rigs.csv").write_text("rig,reason\n0,\n1,\n2,too stiff\n")
    facts = collection_info(root)
    assert (facts.rigs, facts.impossible_rigs, facts.frames) == (3, 1, 8)
    assert facts.complete
    assert facts.bytes == sum(one.bytes for one in facts.datasets)


def test_a_subset_has_the_files_of_the_scene(source: Layout, tmp_path: Path) -> None:
    for name in ("a.stl", "meshes/deeper/b.stl"):
        (source.files / name).parent.mkdir(parents=True, exist_ok=True)
        (source.files / name).write_bytes(name.encode())
    reseal(source)
    small = Layout(tmp_path / "small")
    subset(source.root, small.root, Choice(frames=1))
    assert (small.files / "meshes/deeper/b.stl").read_bytes() == b"meshes/deeper/b.stl"
    assert not list(faults(small.root, (), Counts(), lambda _done, _total: None))
    (source.files / "meshes/deeper/b.stl").write_bytes(b"another")
    with pytest.raises(DamageError, match=r"b\.stl: is not what was generated"):
        subset(source.root, tmp_path / "other", Choice(frames=1))
