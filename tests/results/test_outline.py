"""Outlines: a scene without an outline is refused at once; a reconstruction is drawn."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from results.outline.__main__ import app
from results.outline.measure import Reconstruction
from results.outline.picture import png
from results.outline.true_outline import TrueOutline
from solver.lab.command_end import run_command
from solver.outline.contacts import Contacts
from solver.outline.fit import fit_outline
from tests.command_line import CommandLine
from vbaa_bench.scene.load import load_scene


def test_a_scene_without_a_carriage_is_refused_at_once(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    work = tmp_path / "work"
    refused = CommandLine(lambda: run_command(app), capfd).refused(
        "scenes/quickstart.yaml", "--work", work, "--workers", "1"
    )
    assert "quickstart.yaml: has no carriage" in refused
    assert not work.exists()


def test_a_reconstruction_is_drawn_beside_its_error() -> None:
    normals = np.linspace(0.1, 2 * np.pi, 40)
    directions = np.column_stack([np.cos(normals), np.sin(normals)])
    contacts = Contacts(
        tuple(map(str, range(len(normals)))),
        0.01 * directions,
        normals,
        np.tile(1e-10 * np.eye(2), (len(normals), 1, 1)),
        np.zeros((len(normals), 2, 3)),
        np.full(3, 1e-6),
    )
    truth = TrueOutline(load_scene(Path("scenes/explore/outline.yaml")))
    one = Reconstruction(fit_outline(contacts), contacts, 1e-6 * directions, truth)
    picture = cv2.imdecode(np.frombuffer(png(one, "A disc"), np.uint8), cv2.IMREAD_COLOR)
    assert picture is not None
    left, right = np.split(picture, 2, axis=1)
    red = (left[..., 2] > 120) & (left[..., 0] < 80)
    # The contacts are a circle in the middle of the left chart, as wide as high.
    rows, columns = np.nonzero(red)
    assert np.ptp(rows) == pytest.approx(np.ptp(columns), rel=0.03)
    assert ((right[..., 2] > 120) & (right[..., 0] < 80)).any()
