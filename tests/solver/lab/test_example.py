"""The example rig, which is part of the software: its forces are right."""

import csv
import json
from pathlib import Path

import pytest

from solver.__main__ import main
from solver.antenna import Antenna
from solver.instrument.estimate import Estimate, Outcome
from solver.instrument.observation import open_observations
from solver.lab.check import calibration_report
from solver.lab.example import EXAMPLE, VIDEO
from solver.lab.live import solve_shots
from solver.lab.sources import open_source
from solver.methods import Method
from solver.methods.exact_fit import exact_fit
from solver.methods.push_fit import push_fit, push_fit_friction
from solver.set_up import set_up
from solver.tracker import PushTracker
from tests.command_line import CommandLine

TRUTH = json.loads((Path(__file__).parents[2] / "data" / "example_rig.json").read_text())
MAX_BYTES = 3_000_000


@pytest.fixture(scope="module")
def antenna() -> Antenna:
    return set_up(open_observations(EXAMPLE))


@pytest.fixture
def command(
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
    tmp_path: Path,
    antenna: Antenna,
) -> CommandLine:
    """The real command line in a folder of its own; the example is calibrated already."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("solver.lab.command_line.set_up", lambda *_: antenna)
    return CommandLine(main, capfd)


def within_three_sigmas(estimate: dict[str, float], truth: dict[str, float]) -> bool:
    return all(
        abs(estimate[name] - truth[name]) < 3 * estimate[sigma]
        for name, sigma in (("x_c_mm", "x_c_sigma_mm"), ("force_n", "force_sigma_n"))
    )


def test_the_demo_reads_right_forces_and_says_what_to_do_next(
    command: CommandLine, antenna: Antenna
) -> None:
    ended = command("demo")
    assert ended.status == 0, ended.err
    with Path("demo/estimates.csv").open(encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    assert {row["frame_id"] for row in rows} == set(TRUTH)
    names = ("x_c_mm", "x_c_sigma_mm", "force_n", "force_sigma_n")
    for row in rows:
        assert row["outcome"] == "contact"
        estimate = {name: float(row[name]) for name in names}
        assert within_three_sigmas(estimate, TRUTH[row["frame_id"]])
    assert len(list(Path("demo").glob("*.png"))) == len(TRUTH)
    assert "expect forces within 3 % (one sigma, of EI in rig.json)" in ended.out
    assert "not learned yet: EI: step 5" in ended.out
    assert f"check --rig {EXAMPLE}" in ended.out
    assert calibration_report(antenna).meaning == "good: no problem found"


@pytest.mark.parametrize("method", [push_fit, push_fit_friction])
def test_its_pushes_are_answered_within_three_sigmas(antenna: Antenna, method: Method) -> None:
    tracker = PushTracker(antenna, method)
    for frame in open_observations(EXAMPLE):
        estimate = tracker.solve(frame.image(), frame.readings, frame.push_id).estimate
        assert estimate.values
        for name, value in TRUTH[frame.frame_id].items():
            assert abs(getattr(estimate, name) - value) < 3 * estimate.sigma(name)


@pytest.mark.thorough
def test_the_video_shows_the_same_pushes_after_images_at_rest(antenna: Antenna) -> None:
    answers = list(solve_shots(open_source([str(EXAMPLE / VIDEO)]), antenna, exact_fit))
    outcomes = [answer.solved.estimate.outcome for answer in answers]
    assert outcomes == 3 * [Outcome.NO_CONTACT, Outcome.CONTACT, Outcome.CONTACT]
    contacts: list[Estimate] = [one.solved.estimate for one in answers if one.row["force_n"]]
    for estimate, truth in zip(contacts, TRUTH.values(), strict=True):
        for name, value in truth.items():
            assert abs(getattr(estimate, name) - value) < 3 * estimate.sigma(name)


def test_the_example_is_small_enough_for_a_repository_and_has_no_truth() -> None:
    files = [path for path in EXAMPLE.rglob("*") if path.is_file()]
    assert sum(path.stat().st_size for path in files) <= MAX_BYTES
    assert {path.parent.name for path in files} == {"example", "calibration", "rest", "images"}
    tables = [path for path in files if path.suffix in {".csv", ".json"}]
    assert not any("x_c" in path.read_text() or "force" in path.read_text() for path in tables)


def test_a_copy_without_the_example_gets_a_sentence(
    command: CommandLine, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr("solver.lab.example.EXAMPLE", tmp_path / "example")
    assert "copy solver/ with its folder example/" in command.refused("demo")
