"""Every target's round trip: rendered by the bench, calibrated by the solver."""

from pathlib import Path

import numpy as np
import pytest

from results.calibration.check_camera import Check, check_camera, record
from solver.calibrate.calibration import Calibration
from solver.instrument.board import LineNetwork
from solver.instrument.camera import Camera
from tests.draws import scene_seed
from vbaa_bench.scene.load import load_scene
from vbaa_bench.scene.rigs import nominal_rig

SCENE = """
title: A camera to be found
seed: {seed}
camera: {{width_px: 480, height_px: 300, focal_length_px: 640, distortion: {distortion}}}
optics: {{point_spread_px: 0.5}}
calibration: {{{calibration}}}
render: {{noise_elsewhere: 1.5}}
pushes: {{contact_distance_mm: [100], deflection_pct: [10]}}
"""
# Distortion and calibration target. There is more noise than in a dataset, and there are fewer
# views, so that a target takes a few seconds.
TARGETS = {
    "chessboard": ("[]", "views: 4, columns: 18, rows: 9, square_mm: 13"),
    "charuco": (
        "[-0.25, 0.1, 0.001, -0.0007, -0.02]",
        "views: 4, target: charuco, columns: 17, rows: 9, square_mm: 14",
    ),
    "lines": (
        "[0.1, 0.02, -0.001, 0.0008, 0.005, 0.28, 0.03, 0.01]",
        "views: 4, target: lines, columns: 18, rows: 10, square_mm: 12, line_width_mm: 1.2",
    ),
}


@pytest.mark.parametrize("target", TARGETS)
def test_the_camera_comes_back(target: str, tmp_path: Path, variant: str) -> None:
    distortion, calibration = TARGETS[target]
    path = tmp_path / "scene.yaml"
    text = SCENE.format(seed=scene_seed(3), distortion=distortion, calibration=calibration)
    path.write_text(text, encoding="utf-8")
    file = load_scene(path)
    ticks: list[tuple[int, int]] = []
    checks, found = check_camera(file, variant, lambda done, total: ticks.append((done, total)))
    assert [one for one in checks if not one.passed] == []
    names = [one.quantity for one in checks]
    assert names == ["points on plane C", "focal length", "principal point", "pose"]
    views = file.scene.calibration.views
    assert ticks == [(done + 1, views) for done in range(views)]
    assert isinstance(nominal_rig(file.scene).board, LineNetwork) == (target == "lines")
    assert record(checks, found)["passed"]


def test_one_failure_fails_all() -> None:
    calibration = Calibration(Camera(32, 32, 30, 30, 15.5, 15.5, np.eye(4)), 0.02)
    checks = [Check("focal length", 0.02, 0.03, "%"), Check("pose", 3.5, 3.0, "sigma")]
    found = record(checks, calibration)
    assert [one["passed"] for one in found["checks"]] == [True, False]
    assert not found["passed"]
