"""Looking before rendering: the preview of a frame, and the cost of a dataset."""

import json
import time
from collections import deque
from collections.abc import Callable, Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest
from typer.testing import CliRunner

from solver.instrument.errors import InputError
from tests.conftest import SMALL_SCENE
from vbaa_bench import cli
from vbaa_bench.api import forecast as forecasts
from vbaa_bench.api.forecast import Forecast
from vbaa_bench.report.gallery import TRUTH
from vbaa_bench.workers.jobs import Ended, Job
from vbaa_bench.workers.pool import Pool

# Counts and pictures do not depend on the noise; less noise takes more time.
NOISY_SCENE = f"""{SMALL_SCENE}
render: {{noise_elsewhere: 2, noise_near_beam: 1, sample_table: false}}
"""
# Of a quarter of the pixels.
TINY_SCENE = NOISY_SCENE.replace("width_px: 512", "focal_length_px: 350\n  width_px: 256").replace(
    "height_px: 176", "height_px: 88"
)


@pytest.fixture
def noisy_scene(tmp_path: Path) -> Path:
    path = tmp_path / "noisy.yaml"
    path.write_text(NOISY_SCENE, encoding="utf-8")
    return path


def test_a_preview_shows_the_true_beam_on_the_image(noisy_scene: Path, tmp_path: Path) -> None:
    out = tmp_path / "new" / "frame.png"
    line = ["view", str(noisy_scene), "--frames", "3", "--out", str(out)]
    done = CliRunner().invoke(cli.app, [*line, "--json"])
    assert done.exit_code == 0, done.output
    record = json.loads(done.stdout)
    assert record["picture"] == str(out)
    assert record["truth"]["trial"] == 3
    picture = cv2.imread(str(out))
    assert picture is not None
    assert picture.shape == (352, 1024, 3)
    blue, green, red = np.moveaxis(picture.astype(int), -1, 0)
    drawn = (green > blue + 60) & (green > red + 60)
    assert TRUTH[1] - 20 < green[drawn].max() <= TRUTH[1] + 20
    # Two lines along the beam, from the clamp at the left to the tip at the right.
    columns = np.flatnonzero(drawn.any(axis=0))
    assert columns[0] < 0.1 * 1024
    assert columns[-1] > 0.85 * 1024
    assert 1.5 * np.ptp(columns) < np.count_nonzero(drawn) < 6 * np.ptp(columns)


def test_a_preview_that_cannot_be_written_renders_nothing(
    small_scene: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("vbaa_bench.api.frame.render_frame", lambda *_: pytest.fail("rendered"))
    below_a_file = str(small_scene / "frame.png")
    done = CliRunner().invoke(cli.app, ["view", str(small_scene), "--out", below_a_file])
    assert isinstance(done.exception, InputError)
    assert "cannot be written" in str(done.exception)


@pytest.mark.thorough
def test_a_plan_counts_the_scene_and_states_a_range(tmp_path: Path) -> None:
    path = tmp_path / "tiny.yaml"
    path.write_text(TINY_SCENE, encoding="utf-8")
    done = CliRunner().invoke(
        cli.app, ["generate", str(path), "--plan", "--workers", "1", "--json"]
    )
    assert done.exit_code == 0, done.output
    cost = Forecast(**json.loads(done.stdout))
    assert (cost.frames, cost.pushes, cost.images, cost.workers) == (4, 2, 8, 1)
    assert 0 < cost.hours_low < cost.hours < cost.hours_high < 1
    # Each frame has an image and nine layers of 22,528 pixels, compressed.
    assert 4e4 < 1e9 * cost.gigabytes / cost.frames < 1e6
    assert cost.memory_gb is None or 0.3 < cost.memory_gb < 30


@pytest.mark.thorough
def test_a_probe_ends_when_its_time_is_over(
    noisy_scene: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(forecasts, "LIMIT_S", 0.0)
    done = CliRunner().invoke(cli.app, ["generate", str(noisy_scene), "--plan", "--workers", "1"])
    assert isinstance(done.exception, InputError)
    assert "no frame is rendered in the 0 s of a probe" in str(done.exception)


@pytest.mark.parametrize(
    ("limit", "is_sufficient"), [("LIMIT_S", False), ("SUFFICIENT_S", True)], ids=str
)
def test_what_is_measured_before_the_end_of_a_probe_counts(
    monkeypatch: pytest.MonkeyPatch, limit: str, is_sufficient: bool
) -> None:
    monkeypatch.setattr(forecasts, limit, 0.01)

    class Slow(Pool):
        def outcomes(self, jobs: deque[Job], done: Callable[[int], None]) -> Iterator[Ended]:
            yield Ended(jobs[0], "measured")
            time.sleep(0.02)
            done(1)
            pytest.fail("goes on")

    results, jobs = list[str](), [("image", ("view", 1.0)), ("image", ("view", 1.0))]
    with (
        pytest.raises(forecasts._OutOfTimeError),
        Slow(1, str, ()) as pool,
    ):
        results.extend(forecasts._results(pool, jobs, time.monotonic(), lambda: is_sufficient))
    assert results == ["measured"]


@pytest.mark.thorough
def test_a_plan_of_a_collection_counts_all_rigs(tmp_path: Path) -> None:
    path = tmp_path / "rigs.yaml"
    # Each probed rig is generated as a whole: one push of two frames, in small images.
    text = TINY_SCENE.replace("views: 6", "views: 3").replace("[100, 200]", "[150]")
    path.write_text(text + "rigs: 40\nbackground: {reflectance: {uniform: [0, 0.2]}}\n")
    done = CliRunner().invoke(
        cli.app, ["generate", str(path), "--plan", "--workers", "1", "--json"]
    )
    assert done.exit_code == 0, done.output
    cost = Forecast(**json.loads(done.stdout))
    assert (cost.rigs, cost.frames, cost.pushes, cost.images) == (40, 80, 40, 200)
    assert 0 < cost.hours_low < cost.hours < cost.hours_high < 1
    assert 1e5 < 1e9 * cost.gigabytes / cost.frames < 8e6
    assert str(cost).startswith("40 rigs: 80 frames of 40 pushes, and 200 images ")
    assert str(cost).endswith("number of workers, of which each may grow by 200 MB more")


def test_a_plan_is_said_in_four_lines() -> None:
    cost = Forecast(
        rigs=None,
        frames=270_000,
        pushes=90_000,
        images=14,
        workers=8,
        hours=12.34,
        hours_low=8.0,
        hours_high=0.5,
        gigabytes=81.25,
        memory_gb=3.7,
        probe_s=75.0,
    )
    assert str(cost).splitlines() == [
        "270,000 frames of 90,000 pushes, and 14 images of the board and the beam at rest",
        "time:    12.3 h with 8 workers, between 8 h and 30 min at the machine load of the probe, "
        "which took 1.2 min",
        "disk:    81.2 GB, within about 10 %",
        "memory:  3.7 GB in total, the peak of a probing worker times the number of workers",
    ]


@pytest.mark.parametrize(
    "words", [["--rigs", "0"], ["--part", "1/2"], ["--dask", "local"]], ids=str
)
def test_a_plan_of_less_than_the_scene_is_refused(small_scene: Path, words: list[str]) -> None:
    done = CliRunner().invoke(cli.app, ["generate", str(small_scene), "--plan", *words])
    assert isinstance(done.exception, InputError)
    assert "--plan forecasts the whole scene on this machine" in str(done.exception)
