"""The command lines: what a person types, and what a mistake gets."""

import csv
import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from solver.instrument.images import png_bytes, read_grey
from tests.conftest import SMALL_SCENE

SOLVED = {"two_point", "exact_fit"}

Finished = subprocess.CompletedProcess[str]


def command(*arguments: str | Path, module: str = "vbaa_bench.cli") -> Finished:
    code = f"import {module} as m; m.main()"
    return subprocess.run(
        [sys.executable, "-c", code, *map(str, arguments)],
        capture_output=True,
        text=True,
        check=False,
    )


def check_refused(done: Finished, said: str) -> None:
    """One clear sentence on stderr, exit status 2, no traceback."""
    assert done.returncode == 2, done.stderr
    assert said in done.stderr
    assert "Traceback" not in done.stderr
    assert done.stdout == ""


@pytest.fixture(scope="module")
def finished(dataset: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """`run` over a complete dataset: solved, scored and reported."""
    root = tmp_path_factory.mktemp("run") / "small"
    shutil.copytree(dataset, root)
    scene = root.parent / "small.yaml"
    scene.write_text(SMALL_SCENE, encoding="utf-8")
    methods = [word for name in SOLVED for word in ("--method", name)]
    done = command("run", scene, "--out", root, "--repeats", "1", *methods)
    assert done.returncode == 0, done.stderr
    assert "exact_fit" in done.stdout
    assert f"report: {root / 'report' / 'report.html'}" in done.stdout
    return root


def test_run_ends_with_scores_and_a_report(finished: Path) -> None:
    summary = json.loads((finished / "scores" / "summary.json").read_text())
    assert set(summary["methods"]) == SOLVED
    for found in summary["methods"].values():
        assert found["n"] == 4
        assert found["failure_rate"] == 0
        assert found["ms_per_frame_median"] > 0
    exact, pairs = (
        summary["methods"][name]["x_c_median_abs_pct_L"] for name in ("exact_fit", "two_point")
    )
    assert 10 * exact < pairs
    assert summary["machine"]["cores"] >= 1


def test_the_report_fetches_nothing_and_shows_everything(finished: Path) -> None:
    page = (finished / "report" / "report.html").read_text(encoding="utf-8")
    fetched = re.findall(r"""(?:src|href)\s*=\s*["']([^"'#]+)""", page)
    assert all(target.startswith("data:image/webp;base64,") for target in fetched)
    assert "@import" not in page
    assert "<script" not in page
    for title in ("Speed against error", "Fig. 8 (a)", "Fig. 8 (b)", "Frames", "Failures"):
        assert title in page
    assert page.count("<svg") == 1 + 2 * 2 + 2 + 2
    assert page.count("<figure>") == 4
    for name in ("overlay.png", "speed_against_error.png"):
        assert (finished / "report" / name).read_bytes().startswith(b"\x89PNG")


def test_json_is_one_object_and_nothing_else(finished: Path) -> None:
    scored = command("score", finished, "--json")
    assert set(json.loads(scored.stdout)["methods"]) == SOLVED
    reported = command("report", finished, "--json")
    assert json.loads(reported.stdout)["report"].endswith("report.html")
    healthy = command("doctor", "--json")
    assert json.loads(healthy.stdout)["healthy"] is True


def test_failures_are_listed_in_the_report(finished: Path, tmp_path: Path) -> None:
    root = tmp_path / "copy"
    shutil.copytree(finished, root)
    for path in (root / "predictions").glob("*.csv"):
        lines = path.read_text().splitlines()
        path.write_text("\n".join(lines[:-1]) + "\n")
    assert command("score", root).returncode == 0
    assert command("report", root).returncode == 0
    page = (root / "report" / "report.html").read_text(encoding="utf-8")
    assert page.count("no prediction for this frame") == 2


def test_bad_scenes_are_refused(tmp_path: Path) -> None:
    check_refused(command("run", tmp_path / "none.yaml"), "none.yaml: cannot be read")
    scene = tmp_path / "scene.yaml"
    scene.write_text("title: x\nseed: one\n", encoding="utf-8")
    done = command("generate", scene, "--out", tmp_path / "out")
    check_refused(done, "scene.yaml:2:1: seed is 'one', allowed is a whole number")
    assert not (tmp_path / "out").exists()
    scene.write_text(SMALL_SCENE, encoding="utf-8")
    check_refused(command("generate", scene, "--out", scene / "out"), "cannot be written")
    check_refused(command("generate", scene, "--variant", "fast"), "variant 'fast' is unknown")


def test_bad_datasets_are_refused(finished: Path, tmp_path: Path) -> None:
    for verb in ("solve", "score", "report"):
        check_refused(command(verb, tmp_path / "none"), "none")
    check_refused(command("solve", finished, "--method", "magic"), "method 'magic' is unknown")
    check_refused(command("solve", finished, "--method", "no.such:thing"), "cannot be imported")
    table = finished / "predictions" / "exact_fit.csv"
    check_refused(command("score", finished, "--predictions", table), "scored already")
    check_refused(command("score", finished, "--predictions", tmp_path / "none.csv"), "none.csv")
    root = tmp_path / "copy"
    shutil.copytree(finished, root)
    rig = root / "observations" / "rig.json"
    rig.write_text(rig.read_text().replace("240", "250"))
    check_refused(command("solve", root), "rig.json: is not what was generated")
    (root / "observations" / "hashes.json").write_text("[]")
    check_refused(command("solve", root), "hashes.json: is not a JSON object")
    (root / "scores" / "summary.json").write_text("{")
    check_refused(command("report", root), "summary.json: cannot be read as JSON")


def test_bad_images_are_refused(finished: Path, tmp_path: Path) -> None:
    tree = tmp_path / "observations"
    without = shutil.ignore_patterns("hashes.json")  # as a laboratory's folder has none
    shutil.copytree(finished / "observations", tree, ignore=without)
    image = next(tree.glob("shard_*/*.png"))
    view = tree / "calibration" / "view_00.png"

    def solver(*more: str) -> Finished:
        out = str(tmp_path / "out.csv")
        return command(tree, "--quiet", "--out", out, *more, module="solver.__main__")

    def check_invalid(message: str) -> None:
        done = solver()
        assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
        with (tmp_path / "out.csv").open(encoding="utf-8") as stream:
            rows = list(csv.DictReader(stream))
        bad = [row for row in rows if row["outcome"] == "invalid"]
        assert len(rows) > 1
        assert [row["frame_id"] for row in bad] == [image.stem]
        assert message in bad[0]["message"]

    # A frame's image is its row's matter; what all frames rest on is the run's.
    image.write_bytes(png_bytes(read_grey(image)[:100, :200]))
    check_invalid("the image has 200 x 100 px")
    original = (finished / "observations" / image.relative_to(tree)).read_bytes()
    image.write_bytes(original[:1000])
    check_invalid(f"{image.name}: is not an image that can be decoded")
    image.unlink()
    check_refused(solver(), f"the image {image.name} is missing")
    image.write_bytes(original)
    shutil.copy(view, tmp_path)
    view.write_bytes(image.read_bytes())
    check_refused(solver(), "view 0")
    shutil.copy(tmp_path / "view_00.png", view)
    check_refused(solver("--out", str(view / "x.csv")), "cannot be written")
    (tree / "rig.json").unlink()
    check_refused(solver(), "rig.json: cannot be read")
