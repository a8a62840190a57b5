from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from solver.instrument.camera import Camera
from solver.instrument.rig_json import read_rig, rig_to_json
from solver.instrument.transforms import camera_looking_at
from solver.planes.plane_c import on_plane
from solver.planes.sag import correct_for_sag, scale_error
from tests.simulated import BEAM, rig
from tests.vbaa_bench.mechanics.benches import STEEL
from vbaa_bench.mechanics.pushing import rest
from vbaa_bench.mechanics.rod import Rod

SAG = STEEL * BEAM.length**4 / (8 * BEAM.flexural_rigidity)
CAMERA = Camera(
    512,
    512,
    700.0,
    700.0,
    255.5,
    255.5,
    camera_looking_at(np.array([0.12, 0.02, 0.36]), np.array([0.1206, 0.022, 0.0]), 0.1),
)


def test_a_beam_that_hangs_is_seen_as_if_it_lay_in_plane_c() -> None:
    """The world's own beam under its weight, seen by a camera, against where it would lie."""
    hanging = rest(Rod(BEAM, weight=(0.0, 0.0, -STEEL))).centreline
    assert hanging[-1, 3] == pytest.approx(-SAG, rel=1e-3)
    pixels = CAMERA.project(hanging[:, 1:4])
    seen, _ = on_plane(CAMERA, pixels, np.zeros_like(pixels))
    assert np.abs(seen - hanging[:, 1:3]).max() > 1e-3
    back = correct_for_sag(seen, CAMERA.viewpoint, replace(rig(), sag=SAG))
    assert np.abs(back - hanging[:, 1:3]).max() < 2e-6  # a two-hundredth of a pixel


def test_no_sag_changes_nothing_and_a_telecentric_camera_sees_none_of_it() -> None:
    points = np.column_stack([np.linspace(0, 0.24, 9), np.linspace(0, 0.03, 9)])
    assert correct_for_sag(points, CAMERA.viewpoint, rig()) is points
    above = np.array([0.0, 0.0, 1.0, 0.0])
    assert correct_for_sag(points, above, replace(rig(), sag=SAG)) == pytest.approx(
        points, abs=1e-15
    )
    assert scale_error(above, replace(rig(), sag=SAG)) == 0


def test_the_rig_file_tells_the_sag(tmp_path: Path) -> None:
    path = tmp_path / "rig.json"
    path.write_text(rig_to_json(replace(rig(), sag=SAG)), encoding="utf-8")
    assert read_rig(path).sag == pytest.approx(SAG)
