"""Costs of scenes: each in a process of its own, kept, compared and listed."""

import json
import subprocess
from pathlib import Path
from typing import Any

import polars as pl
import pytest
from typer.testing import CliRunner

from results.scene_speed import measure as speed_scenes
from results.scene_speed.__main__ import app
from results.scene_speed.measure import measure, measure_apart
from results.scene_speed.table import SceneSpeed, cells, compared, markdown, sentence
from solver.instrument.errors import InputError

# A stretch of the beam in a small image.
SCENE = """
title: Small
seed: 3
camera:
  width_px: 96
  height_px: 40
  focal_length_px: 700
  position_mm: [100.0, 8.0, 360.0]
  look_at_mm: [100.2, 8.0, 0.0]
  tip_in_view: false
calibration: {columns: 6, rows: 3, square_mm: 3, center_mm: [100.0, 8.0], views: 3}
pushes: {contact_distance_mm: [110], deflection_pct: [5, 10]}
"""
PARTS = ("mechanics_s", "mesh_s", "render_s", "sensor_s", "files_s")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """One scene that can be measured, one that cannot be read, one with an impossible push."""
    (tmp_path / "hard").mkdir()
    (tmp_path / "fig8_rigid.yaml").write_text(SCENE, encoding="utf-8")
    (tmp_path / "broken.yaml").write_text("camera: none\n", encoding="utf-8")
    impossible = SCENE.replace("[110]", "[400]")
    (tmp_path / "hard" / "beyond_the_tip.yaml").write_text(impossible, encoding="utf-8")
    return tmp_path


def test_a_frame_is_the_sum_of_its_parts_and_a_scene_that_fails_is_a_row_with_its_reason(
    folder: Path, variant: str
) -> None:
    out = folder / "out"
    line = [str(folder), "--out", str(out), "--variant", variant, "--json"]
    done = CliRunner().invoke(app, line)
    assert done.exit_code == 0, done.output
    record = json.loads(done.stdout)
    rows = {row["scene"]: row for row in record["rows"]}
    assert set(rows) == {"fig8_rigid", "broken", "hard/beyond_the_tip"}
    assert (record["scenes"], record["incomplete"]) == (3, 2)

    row = rows["fig8_rigid"]
    assert row["reason"] is None
    assert row["frame_s"] == pytest.approx(sum(row[name] for name in PARTS))
    assert all(row[name] > 0 for name in (*PARTS, "plan_s", "table_s", "boards_s"))
    assert (row["width_px"], row["height_px"], row["ratio"]) == (96, 40, 1)
    assert row["samples"] > 96 * 40 / 10
    assert "title is missing" in rows["broken"]["reason"]
    assert "is 400, allowed is before the tip" in rows["hard/beyond_the_tip"]["reason"]

    table = pl.read_csv(out / "scene_speed.csv")
    assert table["scene"].to_list() == [row["scene"] for row in record["rows"]]
    text = (out / "scene_speed.md").read_text(encoding="utf-8")
    for name, row in rows.items():
        (line_of_scene,) = (one for one in text.splitlines() if one.startswith(f"| {name} |"))
        assert line_of_scene.endswith(f"| {row['reason'] or ''} |")


def test_a_second_run_measures_only_what_is_missing(
    folder: Path, variant: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    results: dict[str, dict[str, Any]] = {"ready": {"frame_s": 0.5}, "late": {"reason": "late"}}
    measured: list[str] = []

    def apart(path: Path, _variant: str, _limit_s: float) -> dict[str, Any]:
        measured.append(path.stem)
        if path.stem not in results:
            raise KeyboardInterrupt
        return results[path.stem]

    def run(limit_s: float) -> tuple[list[str], list[SceneSpeed]]:
        measured.clear()
        counts.clear()
        speeds = measure(paths, folder / "out", variant, limit_s, lambda *n: counts.append(n))
        return list(measured), speeds

    monkeypatch.setattr(speed_scenes, "measure_apart", apart)
    counts: list[tuple[int, int]] = []
    paths = {name: folder / f"{name}.yaml" for name in ("ready", "late", "interrupted")}
    for seed, path in enumerate(paths.values()):
        path.write_text(SCENE.replace("seed: 3", f"seed: {seed}"), encoding="utf-8")
    with pytest.raises(KeyboardInterrupt):
        run(120)
    results["interrupted"] = {"frame_s": 0.25}
    names, speeds = run(120)
    assert names == ["interrupted"]
    assert counts == [(0, 1), (1, 1)]
    assert {speed.scene: speed.frame_s for speed in speeds} == {
        "late": None,
        "ready": 0.5,
        "interrupted": 0.25,
    }
    assert run(60) == ([], speeds)
    # What failed may succeed within a longer limit.
    assert run(240) == (["late"], speeds)
    paths["ready"].write_text(SCENE, encoding="utf-8")
    assert run(120) == (["ready"], speeds)


def test_the_parts_before_the_time_limit_are_kept(
    folder: Path, variant: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = folder / "fig8_rigid.yaml"
    assert measure_apart(path, variant, 0.01) == {"reason": "takes more than 0.01 s"}

    def late(*_: object, **__: object) -> None:
        raise subprocess.TimeoutExpired("command", 9, b'{"plan_s": 1.5}\n{"table_s": 2.5}\n')

    monkeypatch.setattr(subprocess, "run", late)
    expected = {"plan_s": 1.5, "table_s": 2.5, "reason": "takes more than 9 s"}
    assert measure_apart(path, variant, 9) == expected


def test_a_process_that_dies_is_a_reason(
    folder: Path, variant: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    killed = subprocess.CompletedProcess("command", -9, b'{"plan_s": 1.5}\n', b"")
    monkeypatch.setattr(subprocess, "run", lambda *_, **__: killed)
    record = measure_apart(folder / "fig8_rigid.yaml", variant, 9)
    assert record == {"plan_s": 1.5, "reason": "the process ended with status -9"}


def test_scenes_are_sorted_by_cost_and_compared_with_the_papers_rig() -> None:
    speeds = compared(
        [
            SceneSpeed("paper/fig8_rigid", frame_s=0.2, boards_s=1.9),
            SceneSpeed("slow", frame_s=1.8, boards_s=2.1),
            SceneSpeed("too_slow", reason="takes more than 120 s | limit"),
        ]
    )
    assert [speed.scene for speed in speeds] == ["too_slow", "slow", "paper/fig8_rigid"]
    assert [speed.ratio for speed in speeds] == [None, pytest.approx(9), 1]
    assert [speed.frame_passes for speed in speeds] == [None, False, True]
    assert [speed.boards_pass for speed in speeds] == [None, False, True]
    summary = sentence(speeds)
    assert "median ratio to fig8_rigid 5.00 (at most 3: no)" in summary
    assert "largest ratio 9.00 (at most 8 in every scene: no)" in summary
    assert "boards within 2 s in 1 of 3 scenes" in summary
    assert "120 s \\| limit |" in markdown(speeds)


def test_without_the_papers_rig_there_are_no_ratios() -> None:
    speeds = compared([SceneSpeed("a", frame_s=1.0), SceneSpeed("b", frame_s=2.0)])
    heads, rows = cells(speeds)
    assert not any("ratio" in head for head in heads)
    assert [len(row) for row in rows] == [len(heads)] * 2
    assert "ratio" not in sentence(speeds)


def test_a_folder_that_cannot_be_written_is_refused(folder: Path, variant: str) -> None:
    with pytest.raises(InputError, match="cannot be written"):
        measure({}, folder / "fig8_rigid.yaml", variant, 9, lambda _done, _total: None)
    done = CliRunner().invoke(app, [str(folder / "hard" / "none")])
    assert "holds no scene" in str(done.exception)
