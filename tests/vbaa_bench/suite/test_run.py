"""A suite that is run, verified and ranked, with the dataset of the tests."""

import csv
import json
import re
import shutil
from pathlib import Path

import pytest

from solver.instrument.errors import InputError
from tests.command_line import CommandLine
from tests.vbaa_bench.suite.small import CODE, folder_with, write_submission, write_suite
from vbaa_bench import cli
from vbaa_bench.api import results
from vbaa_bench.limits import dataset_limits
from vbaa_bench.suite import leaderboard as leaderboard_module
from vbaa_bench.suite import run as run_module
from vbaa_bench.suite.folder import SuiteFolder, create_folder, open_folder
from vbaa_bench.suite.frozen import NOT_FROZEN, freeze, verify_suite
from vbaa_bench.suite.leaderboard import leaderboard
from vbaa_bench.suite.page import write_leaderboard
from vbaa_bench.suite.run import Request, run_suite
from vbaa_bench.workers.jobs import SameProcess


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("suite")


@pytest.fixture(scope="module")
def ran(place: Path, small_scene: Path, variant: str, dataset: Path) -> SuiteFolder:
    """A folder in which a method, a submission with code and one with predictions were run."""
    suite = write_suite(place, small_scene, variant)
    folder = folder_with(place / "runs", suite, dataset)
    (entry,) = folder.suite.entries()
    names = [
        row["frame_id"]
        for path in sorted(folder.results(entry).dataset.observations.glob("shard_*/metadata.csv"))
        for row in csv.DictReader(path.read_text(encoding="utf-8").splitlines())
    ]
    # Times in predictions files, also beside a kernel, are not ranked.
    rows = "".join(f"{name},120,1,0.1,0.1,1\n" for name in names)
    table = f"frame_id,x_c_mm,x_c_sigma_mm,image_ms,processor_ms,reference_ms\n{rows}"
    code = write_submission(place / "code", suite, "code: mine:halfway", {"mine.py": CODE})
    files = write_submission(
        place / "files", suite, "predictions: {one/pushes: a.csv}", {"a.csv": table}
    )
    method = files / "method.yaml"
    method.write_text(method.read_text(encoding="utf-8").replace("name: mine", "name: guess"))
    with pytest.MonkeyPatch.context() as patch:
        # The start of a worker takes longer than what it computes.
        patch.setattr(dataset_limits, "Pool", SameProcess)
        request = Request((), ("exact_fit",), (code, files), fresh=False, workers=1)
        (made,) = run_suite(folder, request, lambda _line: None)
    assert (made.key, made.frames, made.failed_frames) == ("one/pushes", 4, 0)
    return folder


def test_a_second_run_computes_nothing_again(
    ran: SuiteFolder, monkeypatch: pytest.MonkeyPatch
) -> None:
    def again(*_arguments: object, **_options: object) -> None:
        raise AssertionError

    monkeypatch.setattr(run_module, "dataset_limits", again)
    monkeypatch.setattr(results, "solve", again)
    assert len(list(run_suite(ran, Request((), ("exact_fit",)), lambda _line: None))) == 1


def test_four_pushes_distinguish_no_methods(ran: SuiteFolder) -> None:
    (track,) = leaderboard(ran)
    assert [place.rank for place in track.places] == [None, None, None]
    few = "Methods are not compared: there are fewer than 6 pushes, or rigs."
    assert track.sentence() == few


def test_the_leaderboard_ranks_methods_and_submissions(
    ran: SuiteFolder, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(leaderboard_module, "FEWEST_GROUPS", 2)
    (track,) = leaderboard(ran)
    places = {place.method: place for place in track.places}
    assert track.frames == 4
    assert list(places) == ["exact_fit", "guess", "mine"]
    kinds = ["method of this package", "submission, predictions", "submission, code"]
    assert [place.kind for place in places.values()] == kinds
    assert places["exact_fit"].rank == 1
    # Both guess the middle.
    assert places["mine"].rank == places["guess"].rank == 2
    assert places["exact_fit"].time_rank is not None
    assert places["mine"].time_rank is not None
    assert places["guess"].time_rank is None
    assert places["guess"].figures["ms_median"].value == pytest.approx(0.1)
    assert places["guess"].figures["answered_pct"].value == 100
    assert places["mine"].figures["sigma_over_rmse"].value is None
    over_limit = places["exact_fit"].figures["rmse_over_limit"].value
    assert over_limit is not None
    assert 0.1 < over_limit < 10
    assert track.sentence().startswith("Most accurate: exact_fit. Fastest")


def test_page_and_table_of_the_leaderboard(
    ran: SuiteFolder, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(leaderboard_module, "FEWEST_GROUPS", 2)
    path = write_leaderboard(ran, leaderboard(ran), [])
    page = path.read_text(encoding="utf-8")
    assert "Most accurate: exact_fit." in page
    assert "submission, predictions" in page
    assert 'href="https://example.org/mine"' in page
    assert page.count("not run") == 2
    assert not re.search(r"src=|<script|None|nan", page)
    rows = list(csv.DictReader(path.with_suffix(".csv").read_text(encoding="utf-8").splitlines()))
    assert [(row["track"], row["method"], row["rank"]) for row in rows] == [
        ("one", "exact_fit", "1"),
        ("one", "guess", "2"),
        ("one", "mine", "2"),
    ]
    assert float(rows[0]["error_pct_L_low"]) <= float(rows[0]["error_pct_L"])
    assert rows[1]["time_rank"] == ""


@pytest.mark.thorough
def test_code_is_run_on_a_fresh_seed_and_the_page_says_so(
    ran: SuiteFolder, tmp_path: Path, place: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    copy = tmp_path / "runs"
    shutil.copytree(ran.root, copy)
    folder = open_folder(copy)
    (entry,) = folder.suite.entries()
    seeds = []

    def made(_folder: object, _entry: object, *_others: object, fresh: bool = False) -> object:
        results = folder.results(entry, fresh=fresh)
        if fresh:
            # The same frames: what counts is which seed is asked for.
            seeds.append(folder.suite.scene(entry, folder.fresh_seed).scene.seed)
            shutil.copytree(folder.results(entry).dataset.root, results.root)
            shutil.rmtree(results.predictions)
            shutil.rmtree(results.scores)
        return results

    monkeypatch.setattr(run_module, "_made", made)
    request = Request((), ("exact_fit",), (place / "code",))
    assert len(list(run_suite(folder, request, lambda _line: None))) == 1
    assert seeds == [folder.fresh_seed]
    (track,) = leaderboard(folder)
    fresh = {place.method: place.fresh for place in track.places}
    assert fresh["exact_fit"] is None
    assert fresh["guess"] is None
    assert fresh["mine"] is not None
    page = write_leaderboard(folder, [track], []).read_text(encoding="utf-8")
    assert f"run on seed {folder.fresh_seed}" in page


def test_fingerprints_prove_the_frames(ran: SuiteFolder) -> None:
    (verdict,) = verify_suite(ran)
    assert verdict.holds
    assert verdict.sentence == f"scene, seed and files are the suite's; {NOT_FROZEN}"
    try:
        assert freeze(ran, ("one",)) == ["one/pushes"]
        assert freeze(ran, ("one",)) == []
        (verdict,) = verify_suite(ran)
        assert verdict.sentence.startswith("is the suite's: all ")
        document = json.loads(ran.suite.frozen.read_text(encoding="utf-8"))
        frozen = document["datasets"]["one/pushes"]
        sums = [int(value) for value in frozen["images"].split()]
        for change, rounded in ((3, len(sums)), (10_000, 0)):
            frozen["images"] = " ".join(str(value + change) for value in sums)
            ran.suite.frozen.write_text(json.dumps(document), encoding="utf-8")
            (verdict,) = verify_suite(ran)
            counted = f"0 of {len(sums)} images have the same sums, {rounded} but for rounding"
            assert counted in verdict.sentence
            assert verdict.holds == (rounded > 0)
        with pytest.raises(InputError, match="cannot be frozen: frames are not the suite's"):
            freeze(ran, ("one",))
        document["target"] = "another"
        ran.suite.frozen.write_text(json.dumps(document), encoding="utf-8")
        with pytest.raises(InputError, match="for another, allowed is"):
            list(verify_suite(ran))
    finally:
        ran.suite.frozen.unlink(missing_ok=True)


def test_damage_and_missing_datasets_are_named(ran: SuiteFolder, tmp_path: Path) -> None:
    copy = tmp_path / "runs"
    shutil.copytree(ran.root, copy)
    folder = open_folder(copy)
    (entry,) = folder.suite.entries()
    image = next(folder.results(entry).dataset.observations.glob("shard_*/*.png"))
    image.write_bytes(image.read_bytes()[:-1])
    faults: list[str] = []
    (verdict,) = verify_suite(folder, on_fault=faults.append)
    assert not verdict.holds
    assert image.name in faults[0]
    shutil.rmtree(folder.results(entry).root)
    (verdict,) = verify_suite(folder, ("one",))
    assert verdict.sentence == "is missing; run the suite"
    with pytest.raises(InputError, match="holds no dataset of the suite"):
        list(verify_suite(folder))
    with pytest.raises(InputError, match="holds no scored dataset of the suite"):
        leaderboard(folder)


def test_what_cannot_be_run_is_refused_before_anything_is_rendered(
    small_scene: Path, variant: str, tmp_path: Path
) -> None:
    suite = write_suite(tmp_path, small_scene, variant)
    folder = create_folder(tmp_path / "runs", str(suite))
    other = write_submission(tmp_path / "other", Path("1.0"), "code: mine:f", {"mine.py": "f=1"})
    for request, sentence in (
        (Request(methods=("exact_fits",)), "exact_fits"),
        (Request(tracks=("two",)), "track 'two' is unknown, allowed is one of one"),
        (Request(submissions=(tmp_path,)), r"method\.yaml: is missing"),
        (Request(submissions=(other,)), r"suite is 1\.0, allowed is small"),
    ):
        with pytest.raises(InputError, match=sentence):
            next(run_suite(folder, request, lambda _line: None))
    assert sorted(path.name for path in folder.root.iterdir()) == ["suite.json"]


def test_a_folder_belongs_to_one_version_of_a_suite(
    small_scene: Path, variant: str, tmp_path: Path
) -> None:
    suite = write_suite(tmp_path, small_scene, variant)
    create_folder(tmp_path / "runs", str(suite))
    with pytest.raises(InputError, match=r"holds the suite small, not 1\.0; choose another"):
        create_folder(tmp_path / "runs", "1.0")
    suite.write_text(suite.read_text(encoding="utf-8").replace("repeats: 1", "repeats: 2"))
    with pytest.raises(InputError, match="the suite small has changed since this folder was made"):
        open_folder(tmp_path / "runs")
    with pytest.raises(InputError, match="is no folder of a suite"):
        open_folder(tmp_path)


def test_the_command_reports_in_words_and_as_json(
    ran: SuiteFolder, place: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    command = CommandLine(cli.main, capfd)
    ended = command("suite", "leaderboard", ran.root, "--json")
    assert ended.status == 0, ended
    assert json.loads(ended.out)["tracks"]["one"].startswith("Methods are not compared: ")
    ended = command("suite", "verify", ran.root)
    assert (ended.status, ended.out) == (
        0,
        f"one/pushes: scene, seed and files are the suite's; {NOT_FROZEN}\n",
    )
    assert command("suite", "check", place / "code").status == 0
    (place / "files" / "a.csv").rename(place / "files" / "b.csv")
    ended = command("suite", "check", place / "files")
    assert ended.status == 1
    assert "a.csv: is not a CSV or Parquet table" in ended.out
    assert "--freeze needs --track" in command.refused("suite", "verify", ran.root, "--freeze")
    assert "suite 'x' is unknown" in command.refused("suite", "run", "x", "--out", place / "x")
    assert not (place / "x").exists()
