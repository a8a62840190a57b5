"""Speed against error: every method's times from one process, judged by another."""

import json
import math
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from solver.instrument.errors import InputError
from solver.instrument.estimate import Estimate, Outcome
from solver.instrument.image_frame import ImageFrame
from solver.instrument.measurement import Measurement
from solver.methods import METHODS
from vbaa_bench import cli
from vbaa_bench.api import results as api
from vbaa_bench.benchmarks.speed import measure_apart, with_errors
from vbaa_bench.benchmarks.speed_process import chosen, measure
from vbaa_bench.cli import results as commands
from vbaa_bench.dataset.readers import open_truth
from vbaa_bench.scoring.isolation.runs import Job, MethodRun


def needs_a_sensor(measurement: Measurement) -> Estimate:
    return Estimate(Outcome.INVALID, f"no moment sensor: {measurement.moment_y}")


def fails(measurement: Measurement) -> Estimate:
    raise RuntimeError(f"{len(measurement.points)} points")


def always_there(measurement: Measurement) -> Estimate:
    return Estimate(Outcome.CONTACT, values={"x_c_m": measurement.rig.beam.length / 2})


@pytest.fixture
def methods(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    mine = {f.__name__: f for f in (needs_a_sensor, fails, always_there)}
    for name, method in mine.items():
        monkeypatch.setitem(METHODS, name, method)
    return list(mine)


@pytest.mark.thorough
def test_every_method_has_its_times_and_its_error(dataset: Path, methods: list[str]) -> None:
    measured = measure(dataset / "observations", methods, 10, 2)
    truth = open_truth(dataset / "truth")
    record = with_errors(truth, measured)
    assert record["frames"] == 4
    assert record["image_px"] == [512, 176]
    for name in ("decode_ms_per_frame", "extract_ms_per_frame", "set_up_s"):
        assert 0 < record[name] < math.inf
    found = record["methods"]
    for one in found.values():
        assert 0 < one["image_ms_per_frame"] <= one["image_ms_p95"] < math.inf
        assert one["n"] == 4
        assert "predictions" not in one
    there = found["always_there"]
    errors = (120 - truth.frames["x_c_mm"].to_numpy()) / 2.4
    assert there["x_c_rmse_pct_L"] == pytest.approx(np.sqrt(np.mean(errors**2)))
    assert there["points_us_per_frame"] > 0
    assert found["needs_a_sensor"]["outcomes"] == {"invalid": 4}
    assert found["needs_a_sensor"]["x_c_rmse_pct_L"] is None
    assert found["fails"]["outcomes"] == {"crashed": 4}
    assert found["fails"]["points_us_per_frame"] is None
    json.dumps(record, allow_nan=False)


def test_only_the_frames_that_were_measured_are_with_errors(
    dataset: Path, methods: list[str]
) -> None:
    measured = measure(dataset / "observations", methods[-1:], 1, 1)
    found = with_errors(open_truth(dataset / "truth"), measured)["methods"]["always_there"]
    assert measured["frames"] == found["n"] < 4
    assert found["failure_rate"] == 0


def test_whole_pushes_are_chosen_spread_evenly_in_the_order_of_their_steps() -> None:
    def frame(push: str, step: int) -> ImageFrame:
        return ImageFrame(f"{push}{step}", Path("x.png"), push_id=push, step=step)

    frames = [frame(push, step) for step in (2, 0, 1) for push in "dacbe"]
    assert [one.frame_id for one in chosen(frames, 9)] == [
        f"{push}{step}" for push in "ace" for step in range(3)
    ]
    assert len(chosen(frames, 100)) == 15
    assert [one.step for one in chosen(frames, 1)] == [0, 1, 2]
    alone = [ImageFrame(f"f{i}", Path("x.png")) for i in range(5)]  # frames of no push
    assert len(chosen(alone, 3)) == 3


@pytest.mark.thorough
def test_the_command_says_what_the_issue_of_speed_asks(dataset: Path) -> None:
    line = ["speed", str(dataset), "--method", "exact_fit", "--repeats", "1"]
    done = CliRunner().invoke(cli.app, [*line, "--no-first-ever", "--json"])
    assert done.exit_code == 0, done.output
    record = json.loads(done.stdout)
    (found,) = record["methods"].values()
    for key in ("image_ms_per_frame", "points_us_per_frame", "x_c_rmse_pct_L"):
        assert 0 < found[key] < math.inf
    assert found["x_c_rmse_pct_L"] < 0.3
    cold = found["cold_start"]
    assert cold["total_s"] > cold["import_s"] + cold["set_up_s"] > 0
    assert cold["first_image_ms"] > 0
    assert found["first_start"] is None  # compiling takes a minute
    assert record["machine"]["cores"] >= 1


def test_a_first_start_finds_nothing_compiled_and_a_cold_one_what_there_is(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    (tmp_path / "observations").mkdir()
    kept: list[tuple[str, str | None, bool]] = []

    def run(command: list[str], **how: Any) -> subprocess.CompletedProcess[str]:
        verb, method = command[4], command[6]
        folder = how["env"].get("NUMBA_CACHE_DIR")
        kept.append((verb, folder, folder is None or not any(Path(folder).iterdir())))
        methods = {name: dict[str, Any]() for name in ("two_point", "exact_fit")}
        answer: dict[str, Any] = {"methods": methods} if verb == "measure" else {}
        (Path(folder) / method if folder else tmp_path / "used").write_text("compiled")
        said = json.dumps(answer | {"total_s": len(kept)})
        return subprocess.CompletedProcess(command, 0, stdout=said, stderr="")

    monkeypatch.setattr(subprocess, "run", run)
    methods = ["two_point", "exact_fit"]
    found = measure_apart(tmp_path / "observations", methods, 1, 1)["methods"]
    assert [verb for verb, _, _ in kept] == ["measure", *["start_cold"] * 4]
    assert all(empty for _, _, empty in kept)
    assert [folder is None for _, folder, _ in kept] == [True, True, False, True, False]
    assert found["exact_fit"] == {"cold_start": {"total_s": 4}, "first_start": {"total_s": 5}}


@pytest.mark.thorough
def test_a_mistake_is_one_sentence(dataset: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="method 'magic' is unknown, allowed is one of two_point"):
        measure_apart(dataset / "observations", ["magic"], 1, 1)
    (tmp_path / "rig.json").write_text("{}", encoding="utf-8")
    with pytest.raises(InputError, match=r"could not be measured: .*rig"):
        measure_apart(tmp_path, ["exact_fit"], 1, 1)


def test_all_is_every_method_once(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    processes: list[list[str]] = []

    def solve_each(jobs: list[Job], *_: Any) -> Iterator[MethodRun]:
        processes.append([job.method for job in jobs])
        for job in jobs:
            yield MethodRun(job.out, 1, 0, "")

    monkeypatch.setattr(api, "solve_each", solve_each)
    monkeypatch.setattr(commands, "outcomes", lambda _path: "")
    line = ["solve", str(tmp_path), "--method", "all", "--method", "two_point"]
    done = CliRunner().invoke(cli.app, [*line, "--method", "mine:best", "--json"])
    assert done.exit_code == 0, done.output
    # Our own methods share a process, and its set-up of the rig.
    assert processes == [[*METHODS], ["mine:best"]]
    assert set(json.loads(done.stdout)["predictions"]) == {*METHODS, "mine.best"}
