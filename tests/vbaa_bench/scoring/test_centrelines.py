"""Ways of measuring the beam, side by side: one method, and what each of them costs it."""

import json
import math
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest
from typer.testing import CliRunner

from solver.centreline.extractors import EXTRACTORS
from solver.instrument.images import png_bytes, read_grey
from solver.instrument.observation import open_observations
from solver.methods import METHODS
from solver.set_up import set_up
from solver.tracker import PushTracker
from tests.sealing import reseal
from vbaa_bench import cli
from vbaa_bench.api import results as api
from vbaa_bench.cli import results as commands
from vbaa_bench.scoring.isolation.runs import Job, MethodRun, RunSettings
from vbaa_bench.scoring.results_layout import USUAL_CENTRELINE, Results
from vbaa_bench.scoring.score import found_predictions

PAPER = "two_point@area_weighted"
BOTH = ["--centreline", "profile_fit", "--centreline", "area_weighted"]


def said(*words: str | Path) -> str:
    done = CliRunner().invoke(cli.app, [*map(str, words)])
    assert done.exit_code == 0, done.output
    return done.stdout


@pytest.fixture(scope="module")
def solved(dataset: Path, tmp_path_factory: pytest.TempPathFactory) -> Results:
    """`two_point` on the points of two centrelines; the second frame shows nothing at all."""
    results = Results(shutil.copytree(dataset, tmp_path_factory.mktemp("both") / "small"))
    layout = results.dataset
    empty = open_observations(layout.observations).frames[1].path
    empty.write_bytes(png_bytes(np.full_like(read_grey(empty), 40)))
    reseal(layout)
    said("solve", results.root, "--method", "two_point", *BOTH, "--repeats", "1")
    said("score", results.root)
    return results


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("name", "centreline"), [("two_point", "profile_fit"), (PAPER, "area_weighted")]
)
def test_the_process_of_a_method_measures_as_was_asked_for(
    solved: Results, name: str, centreline: str
) -> None:
    observations = open_observations(solved.dataset.observations)
    antenna = set_up(observations, EXTRACTORS[centreline])
    here = [
        PushTracker(antenna, METHODS["two_point"])
        .solve(frame.image(), frame.readings)
        .estimate.values
        for frame in observations.frames
    ]
    found = pl.read_csv(solved.predictions / f"{name}.csv")["x_c_mm"].fill_null(math.nan)
    expected = [1e3 * values.get("x_c_m", math.nan) for values in here]
    assert found.to_list() == pytest.approx(expected, rel=1e-5, nan_ok=True)
    assert found.is_nan().to_list() == [False, True, False, False]


@pytest.mark.thorough
def test_all_scores_stand_side_by_side(solved: Results) -> None:
    summary = json.loads((solved.scores / "summary.json").read_text(encoding="utf-8"))
    assert list(summary["methods"]) == ["two_point", PAPER]
    lines = said("table", solved.root).splitlines()[2:]
    assert [line.split(" | ")[1] for line in lines] == ["two_point", PAPER]
    page = Path(json.loads(said("report", solved.root, "--json"))["report"])
    assert f"{PAPER}</span></th>" in page.read_text(encoding="utf-8")


def test_a_frame_that_one_centreline_cannot_measure_is_an_outcome(solved: Results) -> None:
    rows = pl.read_parquet(solved.scores / "scores.parquet").filter("failed")
    assert rows["method"].to_list() == ["two_point", PAPER]
    assert rows["refused"].all()
    assert all(rows["message"])


def test_other_centrelines_stand_next_to_their_method(tmp_path: Path) -> None:
    results = Results(tmp_path)
    results.predictions.mkdir()
    names = ["a:own", "exact_fit", PAPER, "two_point", "exact_fit@area_weighted", "zz"]
    for name in names:
        (results.predictions / f"{name.replace(':', '.')}.csv").touch()
    assert list(found_predictions(results)) == [
        *("two_point", PAPER, "exact_fit", "exact_fit@area_weighted", "a.own", "zz")
    ]


@pytest.mark.parametrize(
    ("words", "kept"),
    [
        ([], {"mine.best": "profile_fit"}),
        (BOTH[:2], {"mine.best": "profile_fit"}),
        (BOTH, {"mine.best": "profile_fit", "mine.best@area_weighted": "area_weighted"}),
        ([*BOTH[2:], *BOTH[2:]], {"mine.best@area_weighted": "area_weighted"}),
    ],
)
def test_the_profile_fit_is_the_usual_one_and_has_the_plain_name(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, words: list[str], kept: dict[str, str]
) -> None:
    asked: dict[str, str] = {}

    def solve_each(jobs: list[Job], settings: RunSettings, *_: Any) -> Iterator[MethodRun]:
        for job in jobs:
            asked[job.out.stem] = settings.centreline
            yield MethodRun(job.out, 1, 0, "")

    monkeypatch.setattr(api, "solve_each", solve_each)
    monkeypatch.setattr(commands, "outcomes", lambda _path: "")
    answer = said("solve", tmp_path, "--method", "mine:best", *words, "--json")
    assert set(json.loads(answer)["predictions"]) == set(kept)
    assert asked == kept
    assert EXTRACTORS[USUAL_CENTRELINE] is (set_up.__defaults__ or ())[0]


@pytest.mark.parametrize("command", ["solve", "run"])
def test_an_unknown_centreline_is_refused_before_anything_is_done(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], command: str
) -> None:
    def nothing(*_: Any) -> None:
        pytest.fail("it has begun")

    monkeypatch.setattr(commands, "generate_dataset", nothing)
    monkeypatch.setattr(commands, "solve_dataset", nothing)
    monkeypatch.setattr(sys, "argv", ["vbaa-bench", command, ".", "--centreline", "magic"])
    with pytest.raises(SystemExit) as ended:
        cli.main()
    assert ended.value.code == 2
    assert capsys.readouterr().err.splitlines() == [
        "error: centreline 'magic' is unknown, allowed is one of "
        "profile_fit, background_subtracted, area_weighted"
    ]
