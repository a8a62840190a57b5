"""The command lines: what a person types, and what a mistake gets."""

import csv
import json
import re
import shutil
import subprocess
import sysconfig
from pathlib import Path
from typing import Any

import polars as pl
import pytest
from typer.testing import CliRunner

from solver.__main__ import main as solver_main
from solver.instrument.images import png_bytes, read_grey
from tests.command_line import CommandLine
from tests.conftest import SMALL_SCENE
from vbaa_bench import cli
from vbaa_bench.cli import doctor
from vbaa_bench.dataset.derived import read_limits
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.dataset.recorded import write_results
from vbaa_bench.limits import dataset_limits
from vbaa_bench.render.variant import VARIANTS, Probe
from vbaa_bench.workers.jobs import SameProcess

SOLVED = {"two_point", "exact_fit"}
BOUND = {"bound (planar)"}


@pytest.fixture
def command(capfd: pytest.CaptureFixture[str]) -> CommandLine:
    return CommandLine(cli.main, capfd)


@pytest.fixture(scope="module")
def finished(dataset: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """`run` over a complete dataset: solved, scored and reported. Not to be written to."""
    root = tmp_path_factory.mktemp("run") / "small"
    shutil.copytree(dataset, root)
    scene = root.parent / "small.yaml"
    scene.write_text(SMALL_SCENE, encoding="utf-8")
    methods = [word for name in sorted(SOLVED) for word in ("--method", name)]
    words = ["run", str(scene), "--out", str(root), "--repeats", "1", *methods]
    with pytest.MonkeyPatch.context() as patch:
        # The limits come from this process: the start of others takes longer. `test_dataset_limits`
        # starts them.
        patch.setattr(dataset_limits, "Pool", SameProcess)
        done = CliRunner().invoke(cli.app, words)
    assert done.exit_code == 0, done.output
    assert "exact_fit" in done.stdout
    assert f"report: {root / 'report' / 'report.html'}" in done.stdout
    return root


def test_the_installed_command_has_an_exit_status_and_clean_outputs(finished: Path) -> None:
    def in_a_new_process(*words: str | Path) -> subprocess.CompletedProcess[str]:
        program = Path(sysconfig.get_path("scripts")) / "vbaa-bench"
        return subprocess.run([program, *words], capture_output=True, text=True, check=False)

    printed = in_a_new_process("table", finished, "--json")
    assert (printed.returncode, printed.stderr) == (0, "")
    assert {row["method"] for row in json.loads(printed.stdout)["rows"]} == SOLVED | BOUND
    refused = in_a_new_process("solve", finished, "--centreline", "magic")
    assert (refused.returncode, refused.stdout) == (2, "")
    assert refused.stderr.startswith("error: centreline 'magic' is unknown")
    assert refused.stderr.count("\n") == 1


def test_run_ends_with_scores_and_a_report(finished: Path) -> None:
    summary = json.loads((finished / "scores" / "summary.json").read_text())
    assert set(summary["methods"]) == SOLVED
    for scores in summary["methods"].values():
        assert scores["n"] == 4
        assert scores["failure_rate"] == 0
        assert scores["ms_per_frame_median"] > 0
    exact, pairs = (
        summary["methods"][name]["x_c_median_abs_pct_L"] for name in ("exact_fit", "two_point")
    )
    assert 10 * exact < pairs
    assert summary["machine"]["cores"] >= 1


def test_the_report_fetches_nothing_and_shows_everything(finished: Path) -> None:
    page = (finished / "report" / "report.html").read_text(encoding="utf-8")
    fetched = re.findall(r"""(?:src|href)\s*=\s*["']([^"'#]+)""", page)
    assert all(target.startswith("data:") for target in fetched)
    assert "@import" not in page
    for title in ("Speed against error", "Fig. 8 (a)", "Fig. 8 (b)", "Worst frames", "Outcomes"):
        assert title in page
    # Two pushes of two steps: the worst frame of each push, for both methods.
    assert page.count('<figure class="worst') == 2 * 2
    for name in ("overlay.png", "speed_against_error.png"):
        assert (finished / "report" / name).read_bytes().startswith(b"\x89PNG")


def test_run_stores_the_limits_and_scores_over_them(finished: Path) -> None:
    limits = read_limits(Layout(finished))
    assert limits is not None
    assert set(limits["information"]) == {"planar", "image", "push"}
    scores = pl.read_parquet(finished / "scores" / "scores.parquet")
    assert scores["x_c_limit_pct_L"].is_between(0.001, 0.1).all()


def test_limits_of_a_collection_are_those_of_its_rigs(
    command: CommandLine, finished: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(dataset_limits, "Pool", SameProcess)
    rig = tmp_path / "rig_00003"
    shutil.copytree(finished, rig)
    shutil.rmtree(rig / "derived")
    (tmp_path / "collection.json").write_text("{}")
    record = json_record(command, "limits", tmp_path)
    assert record == {"dataset": str(tmp_path), "frames": 4}
    here, there = read_limits(Layout(rig)), read_limits(Layout(finished))
    assert here is not None
    assert there is not None
    assert here.equals(there)
    message = command.refused("limits", rig, "--require", "x_c_mm=1")
    assert "is a dataset, so that only --workers" in message


def json_record(command: CommandLine, *words: str | Path) -> dict[str, Any]:
    """Run a command with --json, and read all of its standard output as one object."""
    ended = command(*words, "--json")
    assert ended.status == 0, ended.err
    record: dict[str, Any] = json.loads(ended.out)
    return record


def test_json_is_one_object_and_nothing_else(
    command: CommandLine, finished: Path, variant: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert set(json_record(command, "score", finished)["methods"]) == SOLVED
    # Every variant was really probed when this machine's `variant` was chosen.
    monkeypatch.setattr(doctor, "probe", lambda name: Probe(name, name == variant, "probed"))
    diagnosis = json_record(command, "doctor")
    assert diagnosis["healthy"] is True
    assert list(diagnosis["variants"]) == list(VARIANTS)


def test_failures_are_listed_in_the_report(
    command: CommandLine, finished: Path, tmp_path: Path
) -> None:
    root = tmp_path / "copy"
    shutil.copytree(finished, root)
    for path in (root / "predictions").glob("*.csv"):
        lines = path.read_text().splitlines()
        write_results(path.parent, {path.name: ("\n".join(lines[:-1]) + "\n").encode()})
    assert command("score", root).status == 0
    page = Path(json_record(command, "report", root)["report"]).read_text(encoding="utf-8")
    assert page.count("no prediction for this frame") >= 1
    assert "crashed, where the truth is a contact" in page


def test_bad_scenes_are_refused(command: CommandLine, tmp_path: Path) -> None:
    message = command.refused("run", tmp_path / "none.yaml")
    assert "none.yaml: is neither a file nor a shipped scene" in message
    scene = tmp_path / "scene.yaml"
    scene.write_text("title: x\nseed: one\n", encoding="utf-8")
    message = command.refused("generate", scene, "--out", tmp_path / "out")
    assert "scene.yaml:2:1: seed is 'one', allowed is a whole number" in message
    assert not (tmp_path / "out").exists()
    scene.write_text(SMALL_SCENE, encoding="utf-8")
    ended = command("generate", scene, "--out", scene / "out")
    assert (ended.status, ended.out) == (2, "")
    *progress, message = ended.err.splitlines()
    assert message.startswith(f"error: {scene / 'out'}: cannot be written")
    assert all(line.startswith("mechanics") for line in progress)
    message = command.refused("generate", scene, "--variant", "fast")
    assert "variant 'fast' is unknown" in message


def test_bad_datasets_are_refused(command: CommandLine, finished: Path, tmp_path: Path) -> None:
    for verb in ("solve", "score", "report"):
        assert "none" in command.refused(verb, tmp_path / "none")
    message = command.refused("solve", finished, "--method", "no.such:thing")
    assert "cannot be imported" in message
    table = finished / "predictions" / "exact_fit.csv"
    assert "scored already" in command.refused("score", finished, "--predictions", table)
    absent = tmp_path / "none.csv"
    assert "none.csv" in command.refused("score", finished, "--predictions", absent)
    root = tmp_path / "copy"
    shutil.copytree(finished, root)
    rig = root / "observations" / "rig.json"
    rig.write_text(rig.read_text().replace("240", "250"))
    assert "rig.json: is not what was generated" in command.refused("solve", root)
    (root / "observations" / "hashes.json").write_text("[]")
    assert "hashes.json: is not a JSON object" in command.refused("solve", root)
    (root / "scores" / "summary.json").write_text("{")
    assert "summary.json: is not what was generated" in command.refused("report", root)
    write_results(root / "scores", {"summary.json": b"{"})
    assert "summary.json: cannot be read as JSON" in command.refused("report", root)


def test_bad_images_are_refused(
    finished: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    tree = tmp_path / "observations"
    without = shutil.ignore_patterns("hashes.json")  # as a laboratory's folder has none
    shutil.copytree(finished / "observations", tree, ignore=without)
    image = next(tree.glob("shard_*/*.png"))
    view = tree / "calibration" / "view_00.png"
    command = CommandLine(solver_main, capfd)
    words: list[str | Path] = [tree, "--quiet", "--out", tmp_path / "out.csv"]

    def check_invalid(message: str) -> None:
        assert command(*words) == (0, "", "")
        with (tmp_path / "out.csv").open(encoding="utf-8") as stream:
            rows = list(csv.DictReader(stream))
        bad = [row for row in rows if row["outcome"] == "invalid"]
        assert len(rows) > 1
        assert [row["frame_id"] for row in bad] == [image.stem]
        assert message in bad[0]["message"]

    # A bad image of a frame spoils its own row; what all frames depend on ends the run.
    image.write_bytes(png_bytes(read_grey(image)[:100, :200]))
    check_invalid("the image has 200 x 100 px")
    original = (finished / "observations" / image.relative_to(tree)).read_bytes()
    image.write_bytes(original[:1000])
    check_invalid(f"{image.name}: is not an image that can be decoded")
    image.unlink()
    assert f"the image {image.name} is missing" in command.refused(*words)
    image.write_bytes(original)
    shutil.copy(view, tmp_path)
    view.write_bytes(image.read_bytes())
    assert "view 0" in command.refused(*words)
    shutil.copy(tmp_path / "view_00.png", view)
    assert "cannot be written" in command.refused(*words, "--out", view / "x.csv")
    (tree / "rig.json").unlink()
    assert "rig.json: cannot be read" in command.refused(*words)
