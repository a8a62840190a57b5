"""A carriage about an object: where the antenna is, and what it touches on the table."""

import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from results.outline.true_outline import TrueOutline, evenly
from solver.instrument.transforms import apply, turn_about_z
from solver.instrument.units import DEGREE, MILLIMETRE
from tests.conftest import SMALL_SCENE
from tests.consistency import MOST_SIGMAS
from vbaa_bench.assembly.experiment import Experiment
from vbaa_bench.dataset.dataset_columns import TRUTH
from vbaa_bench.generation.readings import readings
from vbaa_bench.generation.truth_row import truth_row
from vbaa_bench.scene.frames import frame_specs
from vbaa_bench.scene.load import SceneFile, load_scene
from vbaa_bench.scene.rigs import true_rig

EXPLORE = Path(__file__).parents[3] / "scenes" / "explore"
CORNERS = 7 * np.array([[np.sin(a), np.cos(a)] for a in np.arange(6) * np.pi / 3])


def scene_of(folder: Path, text: str) -> SceneFile:
    shutil.copy(EXPLORE / "hexagon.stl", folder)
    (folder / "scene.yaml").write_text(f"{SMALL_SCENE}carriage: {{}}\n{text}", encoding="utf-8")
    return load_scene(folder / "scene.yaml")


def rows(file: SceneFile) -> list[tuple[dict[str, Any], dict[str, Any]]]:
    """The truth and the readings of every frame."""
    made = []
    for spec in frame_specs(file.scene):
        experiment = Experiment(spec.scene, true_rig(spec.scene), spec.push, file.path.parent)
        state = experiment.states()[spec.step]
        pose = experiment.table_from_antenna(spec.onset)
        truth = truth_row(experiment, spec, state, None)
        made.append((truth, dict(readings(spec.scene, spec, state, None, pose))))
    return made


def on_table(truth: dict[str, Any]) -> np.ndarray:
    """The contact on the centreline, from Sigma_o by the true pose of the carriage [mm]."""
    table_from_antenna = turn_about_z(truth["true_carriage_turn_deg"] * DEGREE)
    table_from_antenna[:2, 3] = truth["true_carriage_x_mm"], truth["true_carriage_y_mm"]
    return np.asarray(apply(table_from_antenna, np.array([truth["contact_world_mm"]]))[0])


def test_one_hexagon_is_touched_at_its_corners_from_all_sides(tmp_path: Path) -> None:
    file = scene_of(
        tmp_path,
        "tolerances: {true_rig: drawn}\n"
        "object: {kind: mesh, file: hexagon.stl, turn_deg: {uniform: [-180, 180], per: push}}\n",
    )
    made = rows(file)
    for truth, _ in made:
        touched = np.array(truth["touched_table_mm"])
        assert np.linalg.norm(CORNERS - touched[:2], axis=1).min() < 1e-6
        # The beam has a radius of 0.4 mm; its height is that of the drawn rig.
        beside = (on_table(truth) - touched)[:2]
        assert np.linalg.norm(beside) == pytest.approx(0.4, abs=1e-4)
        assert {name for name in truth if "carriage" in name or "table" in name} < set(TRUTH)
    turns = {truth["true_carriage_turn_deg"] for truth, _ in made}
    assert len(turns) == len({truth["push_id"] for truth, _ in made}) > 1


def test_readings_of_a_carriage_are_those_of_its_push_with_noise(tmp_path: Path) -> None:
    errors = []
    for truth, read in rows(scene_of(tmp_path, "object: {kind: cylinder, radius_mm: 6}\n")):
        names = ("x_mm", "y_mm", "turn_deg")
        noise = [read[f"carriage_{name}"] - truth[f"true_carriage_{name}"] for name in names]
        errors.append((read["push_id"], noise))
        assert (read["carriage_sigma_mm"], read["carriage_turn_sigma_deg"]) == (0.005, 0.002)
        assert np.any(noise[:2])
        assert np.abs(noise[:2]).max() < MOST_SIGMAS * 0.005
        assert abs(noise[2]) < MOST_SIGMAS * 0.002
        # The frame of a cylinder begins where it is touched first, on its side.
        touched = np.array(truth["touched_table_mm"][:2])
        assert np.linalg.norm(touched - [0, -6]) == pytest.approx(6)
    of_push = dict(errors)
    assert 1 < len(of_push) < len(errors)
    assert len({tuple(noise) for noise in of_push.values()}) == len(of_push)
    for push, noise in errors:
        assert noise == pytest.approx(of_push[push])


def test_the_true_outline_is_the_section_of_the_mesh(tmp_path: Path) -> None:
    file = scene_of(tmp_path, "object: {kind: mesh, file: hexagon.stl, turn_deg: 25}\n")
    outline = TrueOutline(file)
    along = evenly(CORNERS * MILLIMETRE, closed=True)
    assert len(along) == 2000
    assert outline.distances(along).max() < 1e-9
    assert outline.distances(np.array([[0.0, 8e-3], [0.0, 0.0]])) == pytest.approx(
        [1e-3, 7e-3 * np.cos(np.pi / 6)], rel=1e-6
    )
    directions = np.array([[0.0, 1.0], [1.0, 0.0]])
    assert outline.support(directions) == pytest.approx([7e-3, 7e-3 * np.cos(np.pi / 6)])
