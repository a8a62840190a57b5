"""Small scenes against their committed baselines, and the command compare."""

import io
import json
import shutil
from collections.abc import Callable
from pathlib import Path

import polars as pl
import pytest

from results.regression.alarms import measure
from solver.instrument.errors import InputError
from tests.command_line import CommandLine
from vbaa_bench import cli
from vbaa_bench.dataset.recorded import write_results
from vbaa_bench.generation.generate import generate
from vbaa_bench.scene.load import load_scene
from vbaa_bench.scoring.isolation.runs import Job, RunSettings, solve_each
from vbaa_bench.scoring.results_layout import USUAL_CENTRELINE, Results
from vbaa_bench.scoring.score import found_predictions, score
from vbaa_bench.workers import machine
from vbaa_bench.workers.jobs import SameProcess

pytestmark = pytest.mark.thorough

ROOT = Path(__file__).parents[2]
SCENES = sorted((ROOT / "tests" / "data" / "regression").glob("*.yaml"))
BASELINES = ROOT / "results" / "baselines" / "small"
METHODS = ("linear_fit", "exact_fit", "exact_fit_3d")


@pytest.fixture
def command(capfd: pytest.CaptureFixture[str]) -> CommandLine:
    return CommandLine(cli.main, capfd)


@pytest.fixture(scope="module")
def runs(variant: str, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a scored run of each small scene. Not to be written to."""
    folder = tmp_path_factory.mktemp("runs")
    layouts = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(machine, "Pool", SameProcess)
        for path in SCENES:
            scene = load_scene(path)
            layouts.append(
                generate(scene, folder / path.stem, variant, 0, lambda _done, _total: None)
            )
    jobs = [
        Job(method, layout, Results(layout.root).predictions / f"{method}.csv")
        for layout in layouts
        for method in METHODS
    ]
    for run in solve_each(jobs, RunSettings(USUAL_CENTRELINE, 1, 0.0)):
        assert run.crashed == 0
    for layout in layouts:
        results = Results(layout.root)
        score(results, found_predictions(results))
    return folder


def edited(runs: Path, target: Path, edit: Callable[[pl.DataFrame], pl.DataFrame]) -> Path:
    """A copy of the runs without their images, with other scores."""
    shutil.copytree(runs, target, ignore=shutil.ignore_patterns("*.png"))
    for path in target.glob("*/scores/scores.parquet"):
        data = io.BytesIO()
        edit(pl.read_parquet(path)).write_parquet(data)
        write_results(path.parent, {path.name: data.getvalue()})
    return target


def worse(scores: pl.DataFrame) -> pl.DataFrame:
    error = pl.col("x_c_error_pct_L")
    factor = pl.when(method="exact_fit").then(1.02).otherwise(1.0)
    return scores.with_columns(error * factor)


def scattered(scores: pl.DataFrame) -> pl.DataFrame:
    """Errors of one method 8 times larger in half of the pushes, and 8 times smaller in others."""
    grown = pl.col("push_id").rank("dense") % 2 == 0
    factor = pl.when(method="exact_fit").then(pl.when(grown).then(8.0).otherwise(1 / 8))
    return scores.with_columns(pl.col("x_c_error_pct_L") * factor.otherwise(1.0))


def test_the_small_scenes_are_as_good_as_their_baselines(
    command: CommandLine, runs: Path, tmp_path: Path
) -> None:
    assert {path.stem for path in BASELINES.glob("*.json")} == {path.stem for path in SCENES}
    # Other tests run at the same time: errors are compared, times are not.
    untimed = edited(runs, tmp_path / "untimed", lambda rows: rows.drop("reference_ms"))
    ended = command("compare", untimed, BASELINES, "--json")
    record = json.loads(ended.out)
    reported = [change for change in record["changes"] if change["verdict"] == "worse"]
    assert (ended.status, reported) == (0, [])
    (change,) = (
        change
        for change in record["changes"]
        if (change["method"], change["quantity"]) == ("exact_fit", "x_c error")
    )
    assert (change["scene"], change["pushes"]) == ("all scenes", 12)


def test_a_worse_method_ends_with_status_one(
    command: CommandLine, runs: Path, tmp_path: Path
) -> None:
    baselines = tmp_path / "baselines"
    for run in runs.iterdir():
        assert command("compare", run, baselines / f"{run.name}.json", "--save").status == 0
    assert command("compare", runs, baselines).status == 0
    ended = command("compare", edited(runs, tmp_path / "worse", worse), baselines)
    assert ended.status == 1
    assert "exact_fit" in ended.out
    assert "linear_fit" not in ended.out
    assert "1 worse, 0 better" in ended.out
    scores = edited(runs, tmp_path / "scattered", scattered)
    ended = command("compare", scores, baselines)
    assert ended.status == 0
    assert "1 not distinguishable" in ended.out
    assert command("compare", scores, baselines, "--strict").status == 3
    assert command("compare", runs, baselines, "--strict").status == 0
    assert command("compare", runs, baselines, "--all").out.count("linear_fit") >= 4


def test_an_existing_baseline_is_replaced_with_a_reason(
    command: CommandLine, runs: Path, tmp_path: Path
) -> None:
    run, path = next(runs.iterdir()), tmp_path / "baseline.json"
    assert command("compare", run, path, "--save").status == 0
    assert "state with --why" in command.refused("compare", run, path, "--save")
    assert command("compare", run, path, "--save", "--why", "a reason").status == 0
    assert "without --save" in command.refused("compare", run, path, "--why", "a reason")
    assert "--strict are not allowed" in command.refused("compare", run, path, "--save", "--all")
    assert [entry["why"] for entry in json.loads(path.read_text())["history"]] == [
        "first baseline",
        "a reason",
    ]


def test_what_cannot_be_compared_ends_with_status_two(
    command: CommandLine, runs: Path, tmp_path: Path
) -> None:
    rigid, edges = runs / "small_rigid", BASELINES / "small_knife_edge.json"
    assert "is of another scene than the run" in command.refused("compare", rigid, edges)
    four_pushes = BASELINES / "small_rigid.json"
    assert "fewer than nine pushes" in command.refused("compare", rigid, four_pushes)
    assert "no baseline in this folder" in command.refused("compare", tmp_path, BASELINES)
    assert "cannot be read" in command.refused("compare", rigid, tmp_path / "none.json")
    assert "holds no scores" in command.refused("compare", tmp_path, four_pushes)
    with pytest.raises(InputError, match="at least two runs"):
        measure([rigid])
