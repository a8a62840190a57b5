"""Real sets in a suite: checked, scored with methods, and shown on the leaderboard."""

import csv
import json
import shutil
import sys
from pathlib import Path

import pytest

from solver.instrument.errors import InputError
from solver.instrument.observation import Observations
from solver.lab.protocol import KNOWN, MIN_LOADS
from tests.command_line import CommandLine
from tests.real_set import write_complete_set
from tests.vbaa_bench.suite.small import CODE, write_submission, write_suite
from vbaa_bench import cli
from vbaa_bench.suite.folder import create_folder
from vbaa_bench.suite.real import open_set


@pytest.fixture(scope="module")
def place(
    observations: Observations,
    small_scene: Path,
    variant: str,
    tmp_path_factory: pytest.TempPathFactory,
) -> Path:
    """A folder with a suite, a complete set called wire, and a module with a method."""
    folder = tmp_path_factory.mktemp("real")
    suite = write_suite(folder, small_scene, variant)
    write_complete_set(observations, folder / "wire")
    (folder / "my_method.py").write_text(CODE, encoding="utf-8")
    write_submission(folder / "sent", suite, "code: mine:halfway", {"mine.py": CODE})
    return folder


@pytest.fixture
def command(
    place: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> CommandLine:
    monkeypatch.chdir(place)
    monkeypatch.setattr(sys, "path", list(sys.path))
    return CommandLine(cli.main, capfd)


def test_a_real_set_is_scored_and_shown(place: Path, command: CommandLine) -> None:
    run = ("suite", "run", "small.yaml", "--real", "wire", "--out", "runs")
    ended = command(*run, "--method", "exact_fit", "--method", "my_method:halfway", "--json")
    assert ended.status == 0, ended
    (made,) = json.loads(ended.out)["datasets"]
    assert (made["key"], made["frames"]) == ("real/wire", 2 * MIN_LOADS)
    assert not (place / "runs" / "tracks").exists()
    record = place / "runs" / "real" / "wire.json"
    first = json.loads(record.read_text(encoding="utf-8"))["methods"]
    assert set(first) == {"exact_fit", "my_method.halfway", "hung_weight"}
    ended = command(*run, "--method", "hung_weight", "--submission", "sent")
    assert ended.status == 0, ended
    methods = json.loads(record.read_text(encoding="utf-8"))["methods"]
    assert methods.pop("mine") == first["my_method.halfway"]
    assert methods == first

    ended = command("suite", "leaderboard", "runs", "--json")
    assert ended.status == 0, ended
    shown = json.loads(ended.out)["real"]["wire"]
    pushes = {one["method"]: one for one in shown if one["load"] == "push"}
    # The middle, at which nothing errs by less than a ruler.
    guess = pushes["mine"]
    assert guess["error_pct"] == pytest.approx(100 * 20 / 240)
    assert (guess["n_loads"], guess["answered_pct"]) == (MIN_LOADS, 100)
    assert guess["rms_deviation"] is None
    assert pushes["exact_fit"]["known_pct"] == pytest.approx(100 * 0.5 / 240)
    assert {one["method"] for one in shown if one["load"] == "weight"} == {"hung_weight"}
    text = (place / "runs" / "real.csv").read_text(encoding="utf-8")
    rows = list(csv.DictReader(text.splitlines()))
    assert [(row["set"], row["method"], row["load"]) for row in rows] == [
        ("wire", one["method"], one["load"]) for one in shown
    ]
    page = (place / "runs" / "leaderboard.html").read_text(encoding="utf-8")
    assert "<h3>wire</h3>" in page
    assert "20 × push: x_c, % of L, known to 0.21" in page
    assert "There are none." in page
    assert 'href="https://example.org/mine"' in page
    assert "None" not in page
    ended = command("suite", "leaderboard", "runs")
    assert "real set wire" in ended.out


def test_by_default_methods_of_single_images_solve_the_pushes(
    place: Path, small_scene: Path, variant: str, tmp_path: Path
) -> None:
    suite = write_suite(tmp_path, small_scene, variant)
    opened = open_set(create_folder(tmp_path / "runs", str(suite)), place / "wire")
    remarks: list[str] = []
    names = opened.methods((), remarks.append)
    assert not remarks
    assert opened.methods(("exact_fit_learned", "linear_fit"), remarks.append) == ["linear_fit"]
    (remark,) = remarks
    assert "exact_fit_learned is left out: a real set has no pushes to learn from" in remark
    assert {"two_point", "linear_fit", "exact_fit", "two_contact_fit"} <= set(names)
    assert not {"hung_weight", "exact_fit_learned", "push_fit", "moment_sensor"} & set(names)


def test_an_incomplete_set_is_refused_before_anything_is_run(
    place: Path, command: CommandLine, tmp_path: Path
) -> None:
    broken = shutil.copytree(place / "wire", tmp_path / "wire")
    shutil.rmtree(broken / "ground")
    out = tmp_path / "runs"
    sentence = command.refused(
        *("suite", "run", "small.yaml", "--real", broken, "--track", "one", "--out", out)
    )
    assert f"python -m solver check --protocol {broken} lists what is missing" in sentence
    assert sorted(path.name for path in out.iterdir()) == ["suite.json"]
    none = tmp_path / "none"
    assert f"{none}: is no complete set" in command.refused(
        *("suite", "run", "small.yaml", "--real", none, "--out", out)
    )


def test_another_set_of_the_same_name_is_noticed(
    place: Path, small_scene: Path, variant: str, tmp_path: Path
) -> None:
    suite = write_suite(tmp_path, small_scene, variant)
    folder = create_folder(tmp_path / "runs", str(suite))
    copy = shutil.copytree(place / "wire", tmp_path / "wire")
    open_set(folder, place / "wire").score({}, lambda _line: None)
    (copy / "notes.txt").write_text("Not part of the set.", encoding="utf-8")
    assert open_set(folder, copy).sha256 == open_set(folder, place / "wire").sha256
    known = copy / KNOWN
    known.write_text(known.read_text(encoding="utf-8").replace(",4.25,", ",4.26,", 1))
    with pytest.raises(InputError, match=r"differs from the set that .*wire\.json was made from"):
        open_set(folder, copy)
    # As in one command with two sets of this name.
    other = create_folder(tmp_path / "other", str(suite))
    first, second = open_set(other, place / "wire"), open_set(other, copy)
    first.score({}, lambda _line: None)
    with pytest.raises(InputError, match="differs from the set"):
        second.score({}, lambda _line: None)


def test_a_suite_without_the_track_scores_no_sets(
    place: Path, small_scene: Path, variant: str, tmp_path: Path
) -> None:
    suite = write_suite(tmp_path, small_scene, variant)
    text = suite.read_text(encoding="utf-8")
    suite.write_text(text.partition("real:\n")[0], encoding="utf-8")
    folder = create_folder(tmp_path / "runs", str(suite))
    with pytest.raises(InputError, match=r"small\.yaml: has no track real"):
        open_set(folder, place / "wire")
