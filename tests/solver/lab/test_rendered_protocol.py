"""A rendered set of weights and pushes passes the check, and is answered within its sigmas."""

import csv
import json
import shutil
from pathlib import Path

import pytest

from solver.__main__ import main
from solver.instrument.units import DEGREE
from solver.lab.protocol import KNOWN, MIN_LOADS
from solver.lab.protocol_score import GRAVITY
from tests.command_line import CommandLine
from tests.real_set import write_known
from vbaa_bench import cli
from vbaa_bench.api.data import Dataset, generate
from vbaa_bench.scene.load import load_scene

# Gravity is along +y of the image's plane, to which weights and pegs bend the rod.
SCENE = """
title: A carbon rod under loads
seed: 44
gravity_m_s2: [0, 9.81, 0]
beam: {diameter_mm: 1.5, youngs_modulus_gpa: 130, density_kg_m3: 1600, yield_stress_mpa: 1800,
  paint: black}
tolerances: {true_rig: drawn, flexural_rigidity_pct: 2, gravity_deg: 0.2, board_mm: 0.05,
  board_deg: 0.05, base_mm: 0.05}
camera: {width_px: 400, height_px: 192, focal_length_px: 540, position_mm: [120.0, 24.0, 360.0],
  look_at_mm: [120.6, 24.0, 0.0]}
calibration: {columns: 20, rows: 5, square_mm: 10, center_mm: [120.0, 24.0], views: 6}
sensor: {rest_images: 2, ground_images: 2}
background: {reflectance: 0.3}
"""
WEIGHTS = """
object: {kind: weight, weight_g: {log_uniform: [10, 40], per: push}, thread_length_mm: 8,
  weight_diameter_mm: 6, weight_height_mm: 8, reflectance: 0.3}
pushes:
  contact_distance_mm: [{uniform: [100, 230], per: push}]
  pushing_angle_deg: [0]
  motor_angle_at_contact_deg: [0, 0]
  repeats: 20
"""
PUSHES = """
object: {kind: peg}
pushes:
  contact_distance_mm: [{uniform: [80, 220], per: push}]
  deflection_pct: [{uniform: [4, 12], per: push}]
  motor_angle_at_contact_deg: [0, 0]
  repeats: 20
"""


def write_set(weights: Dataset, pushes: Dataset, folder: Path) -> None:
    """Write two datasets of one rig as a laboratory would; ruler and balance make no error."""
    source = weights.observations.root
    for name in ("calibration", "rest", "ground"):
        shutil.copytree(source / name, folder / name)
    shutil.copy(source / "rig.json", folder)
    (folder / "ruler").mkdir()  # of which only size and depth are checked
    for image in weights.observations.rest_images:
        shutil.copy(image, folder / "ruler" / image.name.replace("rest", "ruler"))
    (folder / "images").mkdir()
    known, readings = list[list[str]](), [["file_name", "motor_angle_deg"]]
    for load, data, place in (("weight", weights, "s_c_mm"), ("push", pushes, "x_c_mm")):
        truth = {row["frame_id"]: row for row in data.truth.frames.iter_rows(named=True)}
        for frame in data.observations.frames:
            row, angle = truth[frame.frame_id], frame.readings.motor_angle
            assert angle is not None
            name = f"{load}_{frame.frame_id}.png"
            shutil.copy(frame.path, folder / "images" / name)
            readings.append([name, f"{angle / DEGREE:.6f}"])
            mass = 1000 * row["force_n"] / GRAVITY
            balance = [f"{mass:.3f}", "0.02"] if load == "weight" else ["", ""]
            known.append([name, load, f"{row[place]:.3f}", "0.5", *balance])
    write_known(folder, known)
    with (folder / "images" / "metadata.csv").open("w", encoding="utf-8", newline="") as stream:
        csv.writer(stream).writerows(readings)


@pytest.fixture(scope="module")
def rendered(variant: str, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A complete set of rendered images."""
    root, data = tmp_path_factory.mktemp("rendered"), {}
    for name, loads in (("weights", WEIGHTS), ("pushes", PUSHES)):
        path = root / f"{name}.yaml"
        path.write_text(SCENE + loads, encoding="utf-8")
        data[name] = generate(load_scene(path), root / name, workers=0, variant=variant)
    folder = root / "wire"
    folder.mkdir()
    write_set(data["weights"], data["pushes"], folder)
    return folder


@pytest.mark.thorough
def test_a_rendered_set_passes_and_is_scored(
    rendered: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    command = CommandLine(main, capfd)
    ended = command("check", "--protocol", rendered, "--json")
    found = json.loads(ended.out)
    assert (ended.status, found["findings"]) == (0, [])
    assert {(one["load"], one["quantity"], one["n_loads"]) for one in found["scores"]} == {
        ("weight", "s_c_mm", MIN_LOADS),
        ("weight", "force_n", MIN_LOADS),
        ("push", "x_c_mm", MIN_LOADS),
    }
    # The force's error is that of EI, to 2 %; a place's is that of the image, below the ruler's.
    for score in found["scores"]:
        assert score["answered_pct"] == 100
        assert score["error_pct"] < (6 if score["quantity"] == "force_n" else 0.5)
        assert score["rms_deviation"] < 3
    folder = shutil.copytree(rendered, tmp_path / "set")
    (folder / KNOWN).unlink()
    ended = command("check", "--protocol", folder)
    assert ended.status == 1
    assert "known.csv" in ended.out


@pytest.mark.thorough
def test_a_suite_scores_a_rendered_set_with_all_methods(
    rendered: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    command, out = CommandLine(cli.main, capfd), tmp_path / "runs"
    ended = command("suite", "run", "1.0", "--real", rendered, "--out", out)
    assert ended.status == 0, ended
    ended = command("suite", "leaderboard", out, "--json")
    assert ended.status == 0, ended
    found = json.loads(ended.out)
    assert found["tracks"] == {}
    scores = {(one["method"], one["quantity"]): one for one in found["real"]["wire"]}
    assert {name for name, _ in scores} >= {"two_point", "linear_fit", "exact_fit", "hung_weight"}
    exact, linear = scores["exact_fit", "x_c_mm"], scores["two_point", "x_c_mm"]
    assert exact["answered_pct"] == scores["hung_weight", "force_n"]["answered_pct"] == 100
    assert exact["within_3_sigma_pct"] == 100
    # Deflections of up to 12 % of the length are too large for linear theory.
    assert exact["error_pct"] < linear["error_pct"] / 2
