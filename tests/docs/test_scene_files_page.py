"""The commands on the page of scene files are possible."""

import re
import shlex
from pathlib import Path

from vbaa_bench.cli.options import rig_numbers
from vbaa_bench.scene.load import load_scene

PAGE = Path(__file__).parents[2] / "docs/scene_files.md"


def test_scenes_on_the_page_exist_and_have_the_values_that_it_sets() -> None:
    loaded = 0
    for line in re.findall(r"^vbaa-bench (?:run|view|generate) .*", PAGE.read_text("utf-8"), re.M):
        _, _, name, *words = shlex.split(line, comments=True)
        options = list(zip(words[::2], words[1::2], strict=True))
        settings = [value for option, value in options if option == "--set"]
        stated = dict(options)
        frames = int(stated["--frames"]) if "--frames" in stated else None
        scene = load_scene(name, int(stated.get("--seed", 1)), settings, frames)
        if "--rigs" in stated:
            assert scene.rigs is not None
            assert rig_numbers(stated["--rigs"], scene.rigs)
        loaded += 1
    assert loaded > 6
