"""Verification names every fault of a dataset in one pass; repair mends what can be rendered."""

import json
import os
import shutil
from collections.abc import Callable
from pathlib import Path

import polars as pl
import pytest
from typer.testing import CliRunner

from solver.instrument.errors import InputError
from solver.instrument.hashes import HASHES
from solver.instrument.image_frame import ImageFrame
from solver.instrument.observation import open_observations
from tests.end_to_end.test_generate import digests
from tests.restoring import Restorer
from tests.sealing import reseal
from vbaa_bench import cli
from vbaa_bench.api.verification import verify
from vbaa_bench.dataset.collection import CollectionLayout
from vbaa_bench.dataset.derived import write_limits
from vbaa_bench.dataset.document import read_json
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.dataset.readers import open_truth
from vbaa_bench.generation import generate as generating
from vbaa_bench.scene.load import load_scene
from vbaa_bench.scoring.results_layout import Results
from vbaa_bench.scoring.score import score
from vbaa_bench.workers import machine


@pytest.fixture
def results(dataset: Path, tmp_path: Path) -> Results:
    """A dataset with limits, predictions of a method, and scores."""
    results = Results(shutil.copytree(dataset, tmp_path / "copy"))
    frames = open_truth(results.dataset.truth).frames
    write_limits(results.dataset, frames.select("frame_id"))
    (results.dataset.derived / "limits.parquet").rename(tmp_path / "limits.parquet")
    shutil.rmtree(results.dataset.derived)
    frames.select("frame_id", "x_c_mm").write_csv(tmp_path / "perfect.csv")
    score(results, {"exact_fit": tmp_path / "perfect.csv"})
    write_limits(results.dataset, frames.select("frame_id"))
    return results


def named(root: Path) -> dict[str, str]:
    return {fault.path.relative_to(root).as_posix(): fault.kind for fault in verify(root).faults}


def flip(path: Path) -> None:
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 4
    path.write_bytes(data)


def test_nothing_is_wrong_with_an_intact_dataset(results: Results) -> None:
    (results.predictions / "mine.csv").write_text("frame_id,x_c_mm\n")
    done = CliRunner().invoke(cli.app, ["verify", str(results.root), "--json"])
    record = json.loads(done.stdout)
    assert done.exit_code == 0
    assert record["faults"] == record["commands"] == []
    assert (record["frames"], record["shards"]) == (4, 2)


def test_all_faults_are_named_in_one_pass(results: Results) -> None:
    root, layout = results.root, results.dataset
    image = next(layout.shard(layout.observations, 0).glob("*.png"))
    layers = next(layout.shard(layout.truth, 1).glob("*.exr"))
    expected = {
        "observations/rest/rest_00.png": "missing",
        "observations/calibration/view_01.png": "damaged",
        image.relative_to(root).as_posix(): "link",
        f"truth/shard_00001/{layers.name}": "damaged",
        f"truth/shard_00000/{HASHES}": "damaged",
        "observations/shard_00001/notes.txt": "surplus",
        "truth/notes.txt": "surplus",
        "observations/shard_00007": "foreign",
        "truth/shard_00007": "foreign",
        ".shard_00003.host-7.part": "surplus",
        "derived/limits.parquet": "damaged",
        "scores/summary.json": "damaged",
        f"predictions/{HASHES}": "missing",
        "predictions/exact_fit.csv": "unrecorded",
    }
    (layout.observations / "rest" / "rest_00.png").unlink()
    shutil.copy(image, root.parent / "image.png")
    image.unlink()
    image.symlink_to(root.parent / "image.png")
    for name, kind in expected.items():
        if kind == "damaged":
            flip(root / name)
        elif kind == "surplus" and not name.startswith("."):
            (root / name).touch()
    for tree in layout.trees:
        shutil.copytree(layout.shard(tree, 1), layout.shard(tree, 7))
    layout.aside("shard_00003", "host-7").mkdir()
    (results.predictions / HASHES).unlink()
    assert named(root) == expected
    done = CliRunner().invoke(cli.app, ["verify", str(root)])
    assert done.exit_code == 1
    assert f"run: vbaa-bench solve {root} --method exact_fit" in done.stdout


@pytest.mark.parametrize(
    ("change", "name", "kind"),
    [
        (lambda layout: layout.hashes.unlink(), f"observations/{HASHES}", "incomplete"),
        (lambda layout: (layout.truth / HASHES).unlink(), f"truth/{HASHES}", "missing"),
        (lambda layout: flip(layout.truth / HASHES), f"truth/{HASHES}", "damaged"),
        (
            lambda layout: shutil.rmtree(layout.shard(layout.truth, 1)),
            "truth/shard_00001",
            "missing",
        ),
    ],
)
def test_a_fault_of_a_whole_tree_is_one_line(
    results: Results, change: Callable[[Layout], None], name: str, kind: str
) -> None:
    change(results.dataset)
    faults = named(results.root)
    faults.pop("derived/limits.parquet", None)  # of another truth, then
    assert faults == {name: kind}


def test_consistent_trees_of_two_datasets_are_foreign(results: Results) -> None:
    layout = results.dataset
    folder = layout.shard(layout.truth, 0)
    table = pl.read_parquet(folder / "truth.parquet")
    table.with_columns(pl.col("frame_id").str.reverse()).write_parquet(folder / "truth.parquet")
    document = read_json(layout.manifest)
    document["scene"]["beam"]["length_mm"] = 1.0
    layout.manifest.write_text(json.dumps(document))
    reseal(layout)
    faults = named(results.root)
    assert faults["truth/manifest.json"] == "foreign"
    assert faults["truth/shard_00000"] == "foreign"
    document["schema"] = 99
    layout.manifest.write_text(json.dumps(document))
    reseal(layout)
    assert named(results.root)["truth/manifest.json"] == "version"


def test_other_folders_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="is neither a dataset nor a collection"):
        verify(tmp_path)


def test_repair_renders_again_and_names_commands(
    results: Results, dataset: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(machine, "Pool", Restorer)
    Restorer.source, Restorer.jobs = Layout(dataset), []
    layout = results.dataset
    flip(layout.identity)
    flip(layout.shard(layout.observations, 1) / "metadata.csv")
    (layout.observations / "rest" / "rest_01.png").unlink()
    (layout.truth / "notes.txt").touch()
    shutil.copytree(layout.shard(layout.truth, 1), layout.shard(layout.truth, 7))
    layout.aside("shard_00003", "host-7").mkdir()
    flip(results.predictions / "exact_fit.csv")
    flip(results.scores / "scores.csv")
    done = CliRunner().invoke(cli.app, ["verify", str(results.root), "--repair", "--json"])
    record = json.loads(done.stdout)
    assert done.exit_code == 0, done.output
    assert len(record["repaired"]) == 9
    assert record["faults"] == []
    assert record["commands"] == [
        f"vbaa-bench solve {results.root} --method exact_fit",
        f"vbaa-bench score {results.root}",
    ]
    whole = digests(dataset)
    assert {name: value for name, value in digests(results.root).items() if name in whole} == whole
    assert len(Restorer.jobs) == 2
    assert not (results.predictions / "exact_fit.csv").exists()


def test_repair_of_what_cannot_be_rendered_says_why(results: Results) -> None:
    layout = results.dataset
    document = read_json(layout.identity)
    flip(layout.manifest)
    flip(layout.identity)
    with pytest.raises(InputError, match="both records of its scene are damaged; state --scene"):
        verify(results.root, repair=True)
    layout.manifest.unlink()
    document |= {"subset": {}, "files": {}}
    layout.identity.write_text(json.dumps(document), encoding="utf-8")
    reseal(layout)
    with pytest.raises(InputError, match="make it again with vbaa-bench subset"):
        verify(results.root, repair=True)


def test_a_collection_is_compared_with_its_tables(dataset: Path, tmp_path: Path) -> None:
    layout = CollectionLayout(tmp_path / "rigs")
    for number in (0, 1, 3):
        shutil.copytree(dataset, layout.rig(number).root)
    layout.write_scene({"title": "Rigs", "rigs": 4}, {})
    reasons = {0: None, 1: "too stiff", 2: None}
    layout.write_rows({n: {"rig": str(n), "reason": reason} for n, reason in reasons.items()})
    assert named(layout.root) == {
        "rig_00001": "surplus",
        "rig_00002": "incomplete",
        "rig_00003": "foreign",
    }
    flip(layout.table)
    flip(next(layout.rig(0).observations.glob("rest/*.png")))
    assert named(layout.root) == {
        "rigs.csv": "damaged",
        "rig_00000/observations/rest/rest_00.png": "damaged",
    }


@pytest.mark.parametrize(
    "name",
    [
        "observations/rest/rest_00.png",
        "observations/shard_00000/hashes.json",
        "observations/hashes.json",
        "truth/shard_00000/truth.parquet",
        "truth/manifest.json",
        "derived/limits.parquet",
        "derived/hashes.json",
    ],
)
def test_a_pipe_in_the_place_of_a_file_is_a_fault(results: Results, name: str) -> None:
    path = results.root / name
    path.unlink()
    os.mkfifo(path)
    assert any(name.rpartition("/")[0] in one for one in named(results.root))


def test_a_pipe_in_the_place_of_an_image_is_replaced(
    results: Results,
    dataset: Path,
    small_scene: Path,
    variant: str,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    shards = results.dataset.shard(results.dataset.observations, 0)
    for path in (shards / next(shards.glob("*.png")), results.dataset.manifest):
        path.unlink()
        os.mkfifo(path)
    with pytest.raises(InputError, match=r"is missing|not a regular file"):
        list(map(ImageFrame.image, open_observations(results.dataset.observations)))
    monkeypatch.setattr(machine, "SameProcess", Restorer)
    Restorer.source, Restorer.jobs = Layout(dataset), []
    file = load_scene(small_scene)
    generating.generate(file, results.root, variant, 0, lambda _done, _total: None)
    assert {k: v for k, v in digests(results.root).items() if k in digests(dataset)} == digests(
        dataset
    )
