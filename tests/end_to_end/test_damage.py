"""A dataset that is damaged, half-sealed, held by another process, or of other code."""

import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from typer.testing import CliRunner

from solver.instrument import files as writing
from solver.instrument.errors import DamageError, InputError
from solver.instrument.files import sha256
from solver.instrument.hashes import HASHES, read_hashes
from solver.instrument.observation import open_observations
from tests.conftest import ALL_LAYERS, SMALL_SCENE
from tests.draws import generator, scene_seed
from tests.end_to_end.test_generate import digests, quiet
from tests.restoring import Restorer
from tests.robustness.damage.damages import kind_of
from tests.sealing import reseal
from tests.vbaa_bench.generation.test_failures import SCENE as SIX_FRAMES
from vbaa_bench import cli
from vbaa_bench.dataset import identity
from vbaa_bench.dataset.copies import copy_observations
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.dataset.lock import locked
from vbaa_bench.dataset.readers import open_truth
from vbaa_bench.dataset.writer import shard_writer
from vbaa_bench.generation import generate as generating
from vbaa_bench.generation.generate import generate
from vbaa_bench.report.report import report
from vbaa_bench.scene.load import SceneFile, load_scene
from vbaa_bench.scoring.overlay import antenna_of
from vbaa_bench.scoring.results_layout import Results
from vbaa_bench.scoring.score import score
from vbaa_bench.workers import machine


def flip(path: Path) -> None:
    data = bytearray(path.read_bytes())
    data[generator(path.name).integers(len(data))] ^= 4
    path.write_bytes(data)


def cut(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-7])


DAMAGES: tuple[Callable[[Path], None], ...] = (flip, cut, Path.unlink)


@pytest.fixture
def restorer(dataset: Path, monkeypatch: pytest.MonkeyPatch) -> type[Restorer]:
    monkeypatch.setattr(machine, "Pool", Restorer)
    Restorer.source, Restorer.jobs = Layout(dataset), []
    return Restorer


@pytest.fixture
def copied(dataset: Path, tmp_path: Path) -> Layout:
    return Layout(shutil.copytree(dataset, tmp_path / "copy"))


def files(root: Path) -> list[Path]:
    return sorted(path.relative_to(root) for path in root.rglob("*") if path.is_file())


def damaged(layout: Layout, source: Path) -> Iterator[tuple[Path, Path]]:
    """A file of every kind, damaged in every way, one after the other."""
    by_kind = {kind_of(name.as_posix()): name for name in files(source)}
    for name in by_kind.values():
        for damage in DAMAGES:
            damage(layout.root / name)
            yield name, layout.root / name
            shutil.copy(source / name, layout.root / name)


@pytest.mark.thorough
def test_every_damage_is_mended_to_the_same_bytes_and_nothing_else_is_made(
    dataset: Path, copied: Layout, small_scene: Path, variant: str, restorer: type[Restorer]
) -> None:
    file, whole = load_scene(small_scene), digests(dataset)
    for name, path in damaged(copied, dataset):
        restorer.jobs.clear()
        remarks: list[str] = []
        generate(file, copied.root, variant, 1, quiet, remark=remarks.append)
        assert digests(copied.root) == whole, name
        folder = name.parent.name
        if name.parts[-1] in ("identity.json", "manifest.json", "rig.json") or len(name.parts) == 2:
            assert all(job.method == "image" for job in restorer.jobs), path
        elif folder.startswith("shard_"):
            assert [job[1][0] for job in restorer.jobs] == [int(folder[-5:])]
            assert folder in remarks[0]
        else:
            assert [job[1][0] for job in restorer.jobs] == [f"{folder}/{name.name}"]
            assert name.name in remarks[0]


def test_damages_are_mended_together_and_what_was_not_generated_goes(
    dataset: Path, copied: Layout, small_scene: Path, variant: str, restorer: type[Restorer]
) -> None:
    kept = copied.shard(copied.observations, 0) / "metadata.csv"
    written = kept.stat().st_mtime_ns
    flip(copied.observations / "calibration" / "view_01.png")
    cut(next(copied.shard(copied.truth, 1).glob("*.exr")))
    (copied.shard(copied.truth, 1) / "more.txt").touch()
    (copied.observations / "more.txt").touch()
    copied.manifest.unlink()
    remarks: list[str] = []
    generate(load_scene(small_scene), copied.root, variant, 1, quiet, remark=remarks.append)
    assert digests(copied.root) == digests(dataset)
    assert kept.stat().st_mtime_ns == written
    assert len(remarks) == 5
    assert len(restorer.jobs) == 2


def test_who_reads_a_damaged_file_names_it_and_how_to_mend_it(
    dataset: Path, copied: Layout, tmp_path: Path
) -> None:
    def score_reads() -> None:
        open_truth(copied.truth)

    def solve_reads() -> None:
        copy_observations(copied, tmp_path / "handed over")
        open_observations(copied.observations)

    for name, path in damaged(copied, dataset):
        tree, last = name.parts[0], name.name
        # A tree that is opened misses every file; of what is there, only what is read is compared.
        unread = last in ("identity.json", "metering.json") or name.suffix == ".exr"
        read_by_score = tree == "truth" and not (unread and path.exists())
        for reads, opens in ((score_reads, read_by_score), (solve_reads, tree == "observations")):
            if last == HASHES and len(name.parts) == 2 and not path.exists():
                if opens or tree == "observations":
                    with pytest.raises(InputError, match="is incomplete; run the command"):
                        reads()
                continue
            if not opens:
                reads()
                continue
            with pytest.raises(DamageError, match="run the command") as refusal:
                reads()
            # A list of hashes may have been damaged in the name of a file.
            assert str(path.parent if last == HASHES else path) in str(refusal.value)


@pytest.mark.thorough
def test_report_reads_no_damaged_image_table_or_manifest(
    dataset: Path, copied: Layout, tmp_path: Path
) -> None:
    results = Results(copied.root)
    frames = open_truth(copied.truth).frames
    frames.select("frame_id", x_c_mm=pl.col("x_c_mm")).write_csv(tmp_path / "perfect.csv")
    score(results, {"perfect": tmp_path / "perfect.csv"})
    names = [
        Path("observations/calibration/view_03.png"),
        Path("observations/rest/rest_01.png"),
        next(path for path in files(dataset) if path.match("observations/shard_*/*.png")),
        Path("truth/shard_00000/truth.parquet"),
        Path("truth/manifest.json"),
    ]
    for name in names:
        flip(copied.root / name)
        # The antenna is set up from the first two; it takes seconds.
        from_images = name.parent.name in ("calibration", "rest")
        set_up = antenna_of if from_images else lambda _results: (None, "not needed")
        with pytest.raises(DamageError, match=name.name):
            report(results, set_up_antenna=set_up)
        shutil.copy(dataset / name, copied.root / name)
    copied.manifest.write_text("{}", encoding="utf-8")
    reseal(copied)
    with pytest.raises(InputError, match=r"manifest\.json: the key scene is missing"):
        report(results)


def test_a_kill_between_two_steps_of_sealing_leaves_it_incomplete_to_all(
    dataset: Path,
    copied: Layout,
    small_scene: Path,
    variant: str,
    restorer: type[Restorer],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    write = writing.write_bytes
    for steps in range(4):
        for path in (copied.hashes, copied.truth / HASHES, copied.manifest):
            path.unlink(missing_ok=True)
        left = iter(range(steps))

        def killed(path: Path, data: bytes, left: Iterator[int] = left) -> None:
            if next(left, None) is None:
                raise KeyboardInterrupt
            write(path, data)

        monkeypatch.setattr("vbaa_bench.dataset.manifest.write_bytes", killed)
        if steps < 3:
            with pytest.raises(KeyboardInterrupt):
                generate(load_scene(small_scene), copied.root, variant, 1, quiet)
            for opened in (
                lambda: open_observations(copied.observations),
                lambda: open_truth(copied.truth),
            ):
                with pytest.raises(InputError, match="incomplete; run the command"):
                    opened()
        else:
            generate(load_scene(small_scene), copied.root, variant, 1, quiet)
            open_observations(copied.observations)
            open_truth(copied.truth)
    assert digests(copied.root) == digests(dataset)
    assert not any(method == "shard" for method, _ in restorer.jobs)


def test_what_the_disk_has_lost_is_not_sealed(
    dataset: Path, copied: Layout, small_scene: Path, variant: str, restorer: type[Restorer]
) -> None:
    class Forgetful(Restorer):
        def image(self, name: str, exposure: float) -> str:
            found = super().image(name, exposure)
            cut(self._layout.observations / name)
            return found

    file = load_scene(small_scene)
    shutil.rmtree(copied.observations / "rest")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(machine, "Pool", Forgetful)
        generate(file, copied.root, variant, 1, quiet)
    with pytest.raises(DamageError, match=r"rest_00\.png: is not what was generated"):
        copy_observations(copied, copied.root / "handed over")
    shutil.rmtree(copied.root / "handed over")
    generate(file, copied.root, variant, 1, quiet)
    assert digests(copied.root) == digests(dataset)
    assert len(restorer.jobs) == 4  # two images, twice


def test_a_full_disk_is_one_sentence(
    copied: Layout, small_scene: Path, variant: str, restorer: type[Restorer]
) -> None:
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    copied.hashes.unlink()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(restorer, "image", full)
        with pytest.raises(InputError, match=r"cannot be written \(No space left on device\)"):
            generate(load_scene(small_scene), copied.root, variant, 1, quiet)
    generate(load_scene(small_scene), copied.root, variant, 1, quiet)
    open_observations(copied.observations)


def test_a_truncated_image_is_not_certified_by_its_shard(tmp_path: Path) -> None:
    layout = Layout(tmp_path)
    for tree in layout.trees:
        tree.mkdir()
    with shard_writer(layout, 0) as writer:
        writer.add("abc", np.ones((9, 9), np.uint8), {"step": 0}, {"x_c_mm": 1.0}, {})
        (aside,) = layout.all_aside("shard_00000")
        cut(aside / "observations" / "abc.png")
    folder = layout.shard(layout.observations, 0)
    table = read_hashes(folder) or {}
    assert table.keys() == {"abc.png", "metadata.csv"}
    assert table["metadata.csv"] == sha256(folder / "metadata.csv")
    assert table["abc.png"] != sha256(folder / "abc.png")


def test_another_title_is_the_same_dataset(
    dataset: Path, copied: Layout, tmp_path: Path, variant: str, restorer: type[Restorer]
) -> None:
    path = tmp_path / "renamed.yaml"
    path.write_text(SMALL_SCENE.replace("Four pushes for the tests", "Renamed"), encoding="utf-8")
    generate(load_scene(path), copied.root, variant, 1, quiet)
    assert not restorer.jobs
    assert open_truth(copied.truth).manifest["scene"]["title"] == "Renamed"
    changed = {
        name for name, value in digests(copied.root).items() if digests(dataset)[name] != value
    }
    assert changed == {"truth/manifest.json", f"truth/{HASHES}"}


def test_what_cannot_be_made_is_refused_before_the_mechanics(
    dataset: Path,
    copied: Layout,
    small_scene: Path,
    variant: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def unreached(*_: object) -> None:
        pytest.fail("it should have been refused before")

    monkeypatch.setattr(generating, "check_possible", unreached)
    monkeypatch.setattr(generating, "true_rig", unreached)
    file = load_scene(small_scene)

    def check_refused(root: Path, sentence: str, changed: str = "") -> None:
        path = tmp_path / "scene.yaml"
        path.write_text(changed or SMALL_SCENE, encoding="utf-8")
        with pytest.raises(InputError, match=sentence):
            generate(load_scene(path), root, variant, 1, quiet)

    check_refused(small_scene / "below_a_file", "cannot be written")
    check_refused(tmp_path / ("n" * 300), r"cannot be written.*too long")
    check_refused(small_scene.parent, "holds other files")
    check_refused(
        tmp_path / "new",
        "are 2,000,000 frames, allowed are 1,000,000",
        SMALL_SCENE.replace("pushes:", "pushes:\n  repeats: 500000"),
    )
    assert not (tmp_path / "new").exists()
    seed = scene_seed(11)
    other = SMALL_SCENE.replace(f"seed: {seed}", "seed: 12")
    check_refused(copied.root, rf"\(seed {seed} -> 12\)", other)
    with locked(copied.lock):
        check_refused(copied.root, "is being written by process")
    monkeypatch.setattr(identity, "code_digests", lambda: {"vbaa_bench.generation.truth_row": "0"})
    with pytest.raises(InputError, match=r"another version of the code.*solve, score and report"):
        generate(file, copied.root, variant, 1, quiet)
    open_truth(copied.truth)
    open_observations(copied.observations)
    assert digests(copied.root) == digests(dataset)


def grown_scene(folder: Path, count: int, method: str = "sobol") -> SceneFile:
    # Bytes are compared: tiny images show as much.
    text = SIX_FRAMES.replace("count: 6", f"count: {count}").replace("sobol", method)
    path = folder / f"{method}_{count}.yaml"
    path.write_text(text.replace("layers: []\n", ALL_LAYERS), encoding="utf-8")
    return load_scene(path)


@pytest.mark.thorough
def test_a_set_grows_and_equals_one_that_was_generated_at_once(
    tmp_path: Path, variant: str
) -> None:
    three, five = (grown_scene(tmp_path, count) for count in (3, 5))
    grown, whole = (Layout(tmp_path / name) for name in ("grown", "whole"))
    generate(three, grown.root, variant, 0, quiet)
    full_shard = grown.shard(grown.observations, 0) / HASHES
    written = full_shard.stat().st_mtime_ns
    remarks: list[str] = []
    generate(five, grown.root, variant, 0, quiet, remark=remarks.append)
    generate(five, whole.root, variant, 0, quiet)
    assert digests(grown.root) == digests(whole.root)
    assert full_shard.stat().st_mtime_ns == written
    assert remarks == []
    with pytest.raises(InputError, match=r"sampling\.count 5 -> 3"):
        generate(three, grown.root, variant, 0, quiet)


def test_a_grid_does_not_grow(tmp_path: Path, variant: str) -> None:
    four, nine = (grown_scene(tmp_path, count, "grid") for count in (4, 9))
    layout = Layout(tmp_path / "data")
    layout.truth.mkdir(parents=True)
    identity.write_identity(layout, identity.dataset_identity(four, variant))
    with pytest.raises(InputError, match="a grid cannot grow, method sobol can"):
        generate(nine, layout.root, variant, 1, quiet)


def test_no_link_leads_a_method_out_of_the_observations(copied: Layout, tmp_path: Path) -> None:
    (copied.observations / "linked").symlink_to(copied.truth)
    (copied.shard(copied.observations, 0) / "linked").symlink_to(copied.truth)
    copy_observations(copied, tmp_path / "handed over")
    assert files(tmp_path / "handed over") == [
        path for path in files(copied.observations) if "linked" not in path.parts
    ]
    assert not list((tmp_path / "handed over").rglob("*.parquet"))


@pytest.mark.parametrize("verb", ["solve", "score", "report"])
def test_names_that_are_too_long_are_refused(verb: str) -> None:
    done = CliRunner().invoke(cli.app, [verb, "n" * 300])
    assert isinstance(done.exception, InputError)
    assert "too long" in str(done.exception)
