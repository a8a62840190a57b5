"""Outlines: a scene without an outline is refused before anything is rendered."""

from pathlib import Path

import pytest

from results.outline.__main__ import app
from solver.lab.command_end import run_command
from tests.command_line import CommandLine


def test_a_scene_without_a_carriage_is_refused_at_once(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    work = tmp_path / "work"
    refused = CommandLine(lambda: run_command(app), capfd).refused(
        "scenes/quickstart.yaml", "--work", work, "--workers", "1"
    )
    assert "quickstart.yaml: has no carriage" in refused
    assert not work.exists()
