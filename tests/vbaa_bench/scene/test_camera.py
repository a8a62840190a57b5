"""The camera's lens and the calibration target, as a scene writes them."""

from pathlib import Path

import pytest

from solver.instrument.board import Board, Charuco, Chessboard, LineNetwork
from solver.instrument.errors import InputError
from vbaa_bench.scene.load import load_scene
from vbaa_bench.scene.rigs import nominal_rig, true_rig
from vbaa_bench.scene.schema import Scene

SCENE = """
title: A camera
seed: 1
camera: {camera}
calibration: {calibration}
pushes: {{contact_distance_mm: [100], deflection_pct: [10]}}
"""


def scene(path: Path, camera: str = "{}", calibration: str = "{}") -> Scene:
    file = path / "scene.yaml"
    file.write_text(SCENE.format(camera=camera, calibration=calibration), encoding="utf-8")
    return load_scene(file).scene


def test_a_lens_goes_to_the_true_camera_and_its_size_to_the_datasheet(tmp_path: Path) -> None:
    one = scene(tmp_path, camera="{distortion: [-0.25, 0.1, 0.001, -0.0007, -0.02]}")
    assert true_rig(one).camera.distortion == (-0.25, 0.1, 0.001, -0.0007, -0.02)
    assert nominal_rig(one).distortion_coefficients == 5
    assert nominal_rig(scene(tmp_path)).distortion_coefficients == 0


@pytest.mark.parametrize(
    ("calibration", "board"),
    [
        ("{}", Chessboard(12, 9, 0.018)),
        (
            "{target: charuco, columns: 8, rows: 6, square_mm: 20, dictionary: 4x4_50}",
            Charuco(8, 6, 0.02, "4x4_50"),
        ),
        (
            "{target: lines, columns: 8, rows: 6, square_mm: 20, line_width_mm: 1.5}",
            LineNetwork(8, 6, 0.02, 0.0015),
        ),
    ],
    ids=["chessboard", "charuco", "lines"],
)
def test_the_target_goes_to_the_datasheet(tmp_path: Path, calibration: str, board: Board) -> None:
    found = nominal_rig(scene(tmp_path, calibration=calibration)).board
    assert type(found) is type(board)
    assert found.corners() == pytest.approx(board.corners())


@pytest.mark.parametrize(
    ("camera", "said"),
    [
        ("{distortion: [0.1, 0.2]}", "distortion holds 2 numbers, allowed are 0, 5 or 8"),
        ("{distortion: [-3, 0, 0, 0, 0]}", "maps different points to the same pixel"),
        ("{distortion: [0, 0, 0, 0, .nan]}", "nan"),
        (
            "{distortion: [0, 0, 0, 0, 0], projection: telecentric, magnification_px_per_mm: 2}",
            "a telecentric one has none",
        ),
    ],
)
def test_a_lens_that_cannot_be_is_refused(tmp_path: Path, camera: str, said: str) -> None:
    with pytest.raises(InputError, match=said):
        scene(tmp_path, camera=camera)


@pytest.mark.parametrize(
    ("calibration", "said"),
    [
        ("{target: lines}", "line_width_mm must be given for the target lines only"),
        ("{line_width_mm: 1}", "line_width_mm must be given for the target lines only"),
        ("{target: lines, line_width_mm: 5}", "line width is 0.278 of a square"),
        ("{target: charuco, dictionary: 4x4_50}", "has 65 markers, the dictionary 4x4_50 only 50"),
        ("{target: dots}", "allowed is one of chessboard, charuco, lines"),
        ("{columns: 12, rows: 10}", "one must be even and one odd"),
    ],
)
def test_a_target_that_cannot_be_is_refused(tmp_path: Path, calibration: str, said: str) -> None:
    with pytest.raises(InputError, match=said):
        scene(tmp_path, calibration=calibration)
