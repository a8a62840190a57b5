"""The truth is in equilibrium and in its units; its last digits do not depend on the processor."""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from solver.instrument.arrays import Floats
from vbaa_bench.assembly.experiment import Experiment
from vbaa_bench.generation.truth_row import truth_row
from vbaa_bench.scene.frames import frame_specs
from vbaa_bench.scene.load import load_scene
from vbaa_bench.scene.rigs import true_rig

ROOT = Path(__file__).parents[3]


def rows() -> str:
    """Some of the truth of the scene with springs, where every column has digits to lose."""
    file = load_scene(ROOT / "scenes" / "fig11_stiffness.yaml")
    rig, folder = true_rig(file.scene), file.path.parent
    made = []
    for spec in sorted(frame_specs(file.scene), key=lambda spec: spec.index)[:112:19]:
        experiment = Experiment(file.scene, rig, spec.push, folder)
        made.append(truth_row(experiment, spec, experiment.states()[spec.step], None))
    return json.dumps(made)


@pytest.mark.thorough
def test_planar_truth_is_the_same_on_every_type_of_processor() -> None:
    # The oldest type runs on every x86-64; elsewhere the name is unknown and changes nothing.
    code = "from tests.vbaa_bench.generation.test_truth_row import rows; print(rows())"
    child = subprocess.run(
        [sys.executable, "-c", code],
        cwd=ROOT,
        env={**os.environ, "OPENBLAS_CORETYPE": "Prescott"},
        capture_output=True,
        text=True,
        check=True,
    )
    assert child.stdout.strip() == rows()


def row_of(scene: str, number: int) -> dict[str, Any]:
    """The row of a frame of a shipped scene of which 50 to 90 mm are hidden."""
    file = load_scene(ROOT / "scenes" / f"{scene}.yaml")
    spec = next(spec for spec in frame_specs(file.scene) if spec.index == number)
    experiment = Experiment(file.scene, true_rig(file.scene), spec.push, file.path.parent)
    return truth_row(experiment, spec, experiment.states()[spec.step], (0.05, 0.09))


def on_centreline(row: dict[str, Any], arc_mm: float) -> Floats:
    """The point (3,) [mm] of the beam at an arc length."""
    arcs = row["centreline_s_mm"]
    return np.array([np.interp(arc_mm, arcs, row[f"centreline_{axis}_mm"]) for axis in "xyz"])


def test_the_truth_of_a_push_against_a_spring() -> None:
    row = row_of("fig11_stiffness", 0)
    contact, force = np.array(row["contact_antenna_mm"]), np.array(row["force_antenna_n"])
    # The scene's clamp is at the origin of Sigma_a, and its beam weighs nothing.
    assert contact == pytest.approx(on_centreline(row, row["s_c_mm"]), abs=1e-3)
    assert np.array(row["base_force_n"]) == pytest.approx(-force, abs=1e-12)
    assert row["base_moment_n_mm"] == pytest.approx(list(-np.cross(contact, force)), abs=1e-9)
    assert row["force_n"] == pytest.approx(np.linalg.norm(force), rel=1e-12)
    assert (row["x_c_mm"], row["y_c_mm"]) == pytest.approx((contact[0], contact[1]), rel=1e-12)
    # The spring of 1 N/m against the beam of round steel, 0.8 mm thick: 3 EI / x_c^3.
    beam = 3 * 200e9 * np.pi * 0.8e-3**4 / 64 / (1e-3 * row["x_c_mm"]) ** 3
    assert row["k_s_n_m"] == 1.0
    assert row["k_s_over_k_beam"] == pytest.approx(1 / beam, rel=1e-9)
    assert row["deflection_pct"] == pytest.approx(row["tip_mm"][1] / 2.4, rel=1e-9)
    assert (row["hidden_from_mm"], row["hidden_to_mm"]) == pytest.approx((50, 90), rel=1e-12)
    assert row["second_s_c_mm"] is None


def test_the_truth_of_two_contacts() -> None:
    row = row_of("hard/two_pegs", 0)
    inner, outer = np.array(row["contact_antenna_mm"]), np.array(row["second_contact_antenna_mm"])
    forces = np.array([row["force_antenna_n"], row["second_force_antenna_n"]])
    assert row["second_s_c_mm"] > row["s_c_mm"] + 10
    assert outer == pytest.approx(on_centreline(row, row["second_s_c_mm"]), abs=1e-2)
    assert np.array(row["base_force_n"]) == pytest.approx(-forces.sum(axis=0), abs=1e-9)
    moment = np.cross(inner, forces[0]) + np.cross(outer, forces[1])
    assert row["base_moment_n_mm"] == pytest.approx(list(-moment), abs=1e-6)
