"""Frames that fail: recorded with their reason, at their own cost alone."""

import gc
import json
import shutil
import weakref
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from typer.testing import CliRunner

from solver.instrument.errors import InputError
from solver.instrument.observation import open_observations
from tests.draws import seeded
from tests.end_to_end.test_generate import digests, quiet
from tests.mortal import Mortal
from tests.poisoned import FATAL_IMAGE, KILLED_IMAGE, Name, PoisonedRigs, PoisonedWorker
from vbaa_bench import cli
from vbaa_bench.dataset.collection import CollectionLayout
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.dataset.readers import open_truth
from vbaa_bench.generation import dataset_worker as dataset_workers
from vbaa_bench.generation import generate as generating
from vbaa_bench.generation import generate_collection as collections
from vbaa_bench.generation.dataset_worker import DatasetWorker, dataset_worker
from vbaa_bench.generation.deaths import DIED, Deaths, ImageError
from vbaa_bench.generation.frame_renderer import FrameRenderer, Metering
from vbaa_bench.generation.generate import generate
from vbaa_bench.generation.inventory import Contents, Inventory, take_inventory
from vbaa_bench.generation.metering_record import MeteringRecord
from vbaa_bench.generation.missing_files import MissingFiles
from vbaa_bench.limits import dataset_limits
from vbaa_bench.render.sample_table import Sampled
from vbaa_bench.render.variant import PLAIN
from vbaa_bench.scene.frames import FrameName, Frames, FrameSpec
from vbaa_bench.scene.load import SceneFile, load_scene
from vbaa_bench.workers import machine
from vbaa_bench.workers.jobs import SameProcess, WorkerDiedError
from vbaa_bench.workers.pool import Pool

SCENE = seeded("""\
title: Six frames
seed: 3
camera: {width_px: 96, height_px: 32, focal_length_px: 130, position_mm: [120, 14, 360],
         look_at_mm: [120, 14, 0]}
calibration: {columns: 20, rows: 5, square_mm: 10, center_mm: [120, 20], views: 3}
sensor: {rest_images: 1}
render: {sample_table: true}
layers: []
sampling: {method: sobol, count: 6, contact_distance_mm: [60, 200], deflection_pct: [3, 6]}
frames_per_shard: 2
""")


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> SceneFile:
    path = tmp_path_factory.mktemp("scene") / "six.yaml"
    path.write_text(SCENE, encoding="utf-8")
    return load_scene(path)


def names(file: SceneFile) -> list[FrameName]:
    return [name for shard in Frames(file.scene).in_shards() for name in shard]


def failures(layout: Layout) -> dict[str, str]:
    tables = sorted(layout.truth.glob("shard_*/failures.json"))
    return {name: why for path in tables for name, why in json.loads(path.read_text()).items()}


def check_frames(layout: Layout, expected: set[str], failed: dict[str, str]) -> None:
    """The dataset has the expected frames, and records the others."""
    assert failures(layout) == failed
    assert set(open_truth(layout.truth).frames["frame_id"]) == expected
    frames = open_observations(layout.observations).frames
    assert {frame.frame_id for frame in frames} == expected
    manifest = json.loads(layout.manifest.read_text())
    assert (manifest["frames"], manifest["failed_frames"]) == (len(expected), len(failed))


def poisoned(root: Path, *images: str) -> MissingFiles:
    """The missing files of a dataset of eight frames in four shards, of which none exists."""
    names: Any = [Name(f"frame {number}", number) for number in range(8)]
    shards = {number: tuple(names[2 * number : 2 * number + 2]) for number in range(4)}
    layout = Layout(root)
    for tree in layout.trees:
        tree.mkdir(parents=True)
    contents = Contents(images=(KILLED_IMAGE, *images), shards=shards, layers=False)
    return MissingFiles(layout, contents, Inventory(), Deaths())


@pytest.mark.thorough
def test_a_frame_at_which_processes_die_costs_itself_alone(tmp_path: Path) -> None:
    missing, counts = poisoned(tmp_path), list[int]()
    with Pool(2, PoisonedWorker, (tmp_path,)) as pool:
        missing.generate(pool, lambda done, _total: counts.append(done))
    # Another frame, at which a process died once, is there.
    assert failures(missing.layout) == {"frame 1": DIED, "frame 3": DIED}
    assert {path.stem for path in missing.layout.observations.rglob("*.png")} == {
        f"frame {number}" for number in range(8) if number not in (1, 3)
    }
    inventory = take_inventory(missing.layout, missing.contents)
    assert inventory.failed == missing.inventory.failed == {0: 1, 1: 1, 2: 0, 3: 0}
    assert not missing.layout.all_aside()
    assert counts[-1] == 10


def test_an_image_at_which_processes_die_ends_the_dataset_with_one_sentence(tmp_path: Path) -> None:
    whole = poisoned(tmp_path, FATAL_IMAGE)
    missing = replace(whole, contents=replace(whole.contents, shards={}))
    with (
        Pool(1, PoisonedWorker, (tmp_path,)) as pool,
        pytest.raises(
            ImageError, match=r"^calibration/view_07\.png cannot be rendered: the process .* died 2"
        ),
    ):
        missing.generate(pool, quiet)
    assert not missing.layout.all_aside()


@pytest.mark.thorough
def test_an_image_at_which_processes_die_costs_its_rig_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(collections, "RigGenerator", PoisonedRigs)
    path = tmp_path / "rigs.yaml"
    path.write_text(SCENE + "rigs: 3\nbeam: {length_mm: {uniform: [239, 241]}}\n")
    root = tmp_path / "data"
    results = collections.generate_collection(load_scene(path), root, "llvm_ad_mono", 1, quiet)
    reason = "the board cannot be rendered: the process that rendered it died 2 times"
    assert [result.reason for result in results] == ["", reason, ""]
    rows = CollectionLayout(root).read_rows()
    assert {number: row["reason"] for number, row in rows.items()} == {0: None, 1: reason, 2: None}
    assert round(float(rows[1]["beam.length_mm"] or 0)) in {239, 240, 241}
    assert not CollectionLayout(root).rig(1).root.exists()


def test_an_image_that_cannot_be_rendered_costs_its_rig(
    file: SceneFile, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def dark(*_: object) -> None:
        raise ArithmeticError("3 of 9 pixels have no radiance")

    class Dark(DatasetWorker):
        def __post_init__(self) -> None:
            self.renderer: Any = SimpleNamespace(
                rest_image=dark, board_image=dark, ground_image=dark
            )

    def generated(_file: SceneFile, root: Path, *_: object, **__: object) -> None:
        (root / "truth").mkdir(parents=True)
        Dark(file, Layout(root), "", 1).image(lambda: None, "rest/rest_00.png", 1.0)

    monkeypatch.setattr(collections, "generate", generated)
    rigs = collections.RigGenerator(file, "", 1)
    result = rigs.rig(lambda: None, 4, tmp_path / "rig_00004", {})
    reason = "rest/rest_00.png cannot be rendered: ArithmeticError: 3 of 9 pixels have no radiance"
    assert (result.reason, result.row["reason"]) == (reason, reason)
    assert not (tmp_path / "rig_00004").exists()


def test_the_renderer_of_a_rig_is_freed_before_the_next(
    file: SceneFile, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Renderer:
        def __init__(self) -> None:
            self.itself = self

    def generated(_file: SceneFile, root: Path, *_: object, **__: object) -> None:
        renderer = Renderer()
        renderers.append(weakref.ref(renderer))
        (root / "truth").mkdir(parents=True)
        Layout(root).manifest.write_text('{"failed_frames": 0}')

    renderers = list[weakref.ref[Renderer]]()
    monkeypatch.setattr(collections, "generate", generated)
    gc.disable()
    try:
        collections.RigGenerator(file, "", 1).rig(lambda: None, 0, tmp_path / "rig", {})
        assert [renderer() for renderer in renderers] == [None]
    finally:
        gc.enable()


def test_processes_that_die_for_other_reasons_end_the_command(tmp_path: Path) -> None:
    with (
        Pool(1, Mortal, ()) as pool,
        pytest.raises(WorkerDiedError, match="repeat the command to resume"),
    ):
        poisoned(tmp_path).generate(pool, quiet)


@pytest.mark.thorough
def test_a_frame_that_cannot_be_rendered_is_recorded(
    file: SceneFile, variant: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def rendered(worker: DatasetWorker, name: FrameName, metering: Metering) -> Any:
        if name in broken:
            raise RuntimeError(f"no light at {worker.file.path.parent}/lamp\nand more")
        return DatasetWorker.frame(worker, name, metering)

    class Broken(DatasetWorker):
        frame = rendered

    def broken_worker(*arguments: Any) -> DatasetWorker:
        worker = dataset_worker(*arguments)
        return Broken(worker.file, worker.layout, worker.variant, worker.threads)

    broken = names(file)[2:4]  # a whole shard
    monkeypatch.setattr(generating, "dataset_worker", broken_worker)
    layout = generate(file, tmp_path / "data", variant, 0, quiet)
    reasons = {name.frame_id: "RuntimeError: no light at lamp" for name in broken}
    check_frames(layout, {name.frame_id for name in names(file)} - reasons.keys(), reasons)
    # The record is complete: nothing is rendered again.
    before = digests(layout.root)
    monkeypatch.setattr(machine, "SameProcess", None)
    generate(file, layout.root, variant, 0, quiet)
    assert digests(layout.root) == before


@pytest.mark.thorough
def test_a_dataset_has_one_metering_whatever_happens_to_its_frames(
    file: SceneFile, variant: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Frame 1 has two passing errors while it is metered; frame 0 is given up at first only."""

    if variant == PLAIN:
        pytest.skip("a scalar variant has no sample table")

    class Passing(FrameRenderer):
        def _sampled(self, spec: FrameSpec, metering: Metering, number: int) -> Sampled:
            if spec.index == 1 and errors:
                raise RuntimeError(errors.pop())
            return super()._sampled(spec, metering, number)

    errors, ids = ["no light", "no light"], [name.frame_id for name in names(file)]
    monkeypatch.setattr(dataset_workers, "FrameRenderer", Passing)
    layout, failed = Layout(tmp_path / "data"), {ids[0]: DIED, ids[1]: "RuntimeError: no light"}
    generate(file, layout.root, variant, 0, quiet, given_up={ids[0]: DIED})
    check_frames(layout, set(ids[2:]), failed)
    record = MeteringRecord.read(layout.metering)
    assert (record.frames, record.failed) == ((ids[2],), failed)
    before = digests(layout.root)
    for tree in layout.trees:
        shutil.rmtree(layout.shard(tree, 1))
    generate(file, layout.root, variant, 0, quiet)
    assert digests(layout.root) == before
    # A second metering, of all frames, would differ.
    layout.metering.unlink()
    with pytest.raises(InputError, match=r"metering\.json: is damaged, .* differ from those"):
        generate(file, layout.root, variant, 0, quiet)


@pytest.mark.thorough
def test_an_impossible_push_is_recorded_by_the_command(
    variant: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(machine, "Pool", SameProcess)
    path = tmp_path / "tip.yaml"
    nine = SCENE.replace("method: sobol, count: 6", "method: grid, count: 9")
    nine = nine.replace("[3, 6]", "[10, 20]")
    path.write_text(nine.replace("[60, 200]", "[238, 239.99]"))
    done = CliRunner().invoke(
        cli.app, ["generate", str(path), "--out", str(tmp_path / "data"), "--json"]
    )
    assert done.exit_code == 1, (done.output, done.exception)
    layout = Layout(tmp_path / "data")
    record = json.loads(done.stdout)
    assert record["frames"] + record["failed_frames"] == 9
    assert record["failed_frames"] == len(failures(layout)) == 2
    assert all("slips off" in reason for reason in failures(layout).values())
    assert str(tmp_path) not in "".join(failures(layout).values())
    assert "frames failed; the reasons are in truth/shard_*/failures.json" in done.stderr
    # The limits are those of the frames that exist.
    monkeypatch.setattr(dataset_limits, "Pool", SameProcess)
    table = dataset_limits.dataset_limits(layout.root, variant, 1, quiet)
    assert table["frame_id"].n_unique() == record["frames"]
    # More than half of the pushes: the scene is refused.
    path.write_text(nine.replace("[60, 200]", "[239.5, 239.99]"))
    done = CliRunner().invoke(cli.app, ["generate", str(path), "--out", str(tmp_path / "none")])
    assert "slips off" in str(done.exception)
    assert not (tmp_path / "none").exists()
