"""Every machine renders the frozen frames of the suite, but for rounding."""

from pathlib import Path

import pytest

from vbaa_bench.api import data
from vbaa_bench.dataset.target import FAST
from vbaa_bench.suite.folder import create_folder
from vbaa_bench.suite.frozen import NOT_FROZEN, verify_suite

KEY = "lite/quickstart"


@pytest.mark.thorough
def test_this_machine_renders_the_frozen_frames(tmp_path: Path, variant: str) -> None:
    if variant != FAST:
        pytest.skip("frames are frozen for another variant")
    folder = create_folder(tmp_path / "suite", "1.0")
    (entry,) = (entry for entry in folder.suite.entries() if entry.key == KEY)
    data.generate(folder.suite.scene(entry), folder.results(entry).root)
    (verdict,) = (verdict for verdict in verify_suite(folder) if verdict.key == KEY)
    assert verdict.holds, verdict.sentence
    assert NOT_FROZEN not in verdict.sentence
