"""The command `outline`: a scene without an outline is refused before anything is rendered."""

from pathlib import Path

import pytest

from tests.command_line import CommandLine
from vbaa_bench.cli import main


def test_a_scene_without_a_carriage_is_refused_at_once(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    work = tmp_path / "work"
    refused = CommandLine(main, capfd).refused(
        "outline", "scenes/quickstart.yaml", "--work", work, "--workers", "1"
    )
    assert "quickstart.yaml: has no carriage" in refused
    assert not work.exists()
