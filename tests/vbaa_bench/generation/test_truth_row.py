"""The truth's last digits do not depend on the type of processor that BLAS finds."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

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
