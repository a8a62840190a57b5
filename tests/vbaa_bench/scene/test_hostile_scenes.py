"""Scenes that are damaged or malicious get one sentence each, at once, and never a traceback."""

import os
from pathlib import Path

import pytest

from solver.instrument.errors import LONGEST_SHOWN, InputError
from tests.conftest import SCENE_TEXT
from vbaa_bench.scene.load import MAX_FILE_BYTES, load_scene
from vbaa_bench.scene.mistakes import MAX_MISTAKES


def refusal(path: Path, text: str) -> str:
    """What is said of a scene; nothing where it is accepted."""
    path.write_text(text, encoding="utf-8")
    try:
        load_scene(path)
    except InputError as error:
        return str(error)
    return ""


def bomb() -> str:
    """A list of nine values, nine times, nine times ...: 9^9 values in a few hundred bytes."""
    lines = ["a: &a [1, 1, 1, 1, 1, 1, 1, 1, 1]"]
    for one, more in zip("abcdefgh", "bcdefghi", strict=True):
        lines.append(f"{more}: &{more} [{', '.join([f'*{one}'] * 9)}]")
    return "\n".join(lines) + SCENE_TEXT


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("seed: 11", "seed: !!float b", "could not convert string to float: 'b'"),
        ("seed: 11", "seed: !!set x", "is not valid YAML for a scene"),
        ("seed: 11", "seed: &a 11\ncamera: &a {}", "found duplicate anchor 'a'"),
        ("seed: 11", "? key: [1]", "is not valid YAML for a scene"),
        ("title:", "%FOO x\ntitle:", "is not YAML"),
        ("seed: 11", f"seed: {'[' * 1000}{']' * 1000}", ":3:1: is nested too deeply"),
        ("seed: 11", f"seed: {'9' * 5000}", "is not valid YAML for a scene"),
        ("seed: 11", f"seed: 0x{'f' * 5000}", "holds a whole number of 20,000 bits, allowed"),
        ("seed: 11", f"seed: 11\n? 0x{'f' * 5000}\n: 1", "holds a whole number of 20,000 bits"),
        ("seed: 11", "seed: 11\nbeam: &a {beam: *a}", "beam.beam is an unknown key"),
        ("[10, 20]", "[10, 20]\n  repeats: 1000000000", "repeats is 1000000000, allowed is"),
        (
            "[10, 20]",
            "[10, 20]\n  repeats: 500000",
            "2 contact distances x 500,000 repeats x 2 steps are 2,000,000 frames, allowed are",
        ),
        ("seed: 11", f"seed: {'x' * MAX_FILE_BYTES}", "is too large, allowed are 100,000 bytes"),
    ],
)
def test_hostile_scenes_are_refused_at_the_door(
    tmp_path: Path, old: str, new: str, said: str
) -> None:
    found = refusal(tmp_path / "scene.yaml", SCENE_TEXT.replace(old, new))
    assert said in found
    assert len(found) < 1000


def test_aliases_of_aliases_are_counted(tmp_path: Path) -> None:
    assert "holds too many values" in refusal(tmp_path / "scene.yaml", bomb())


def test_long_values_and_long_lists_of_mistakes_are_shortened(tmp_path: Path) -> None:
    path = tmp_path / "scene.yaml"
    assert len(refusal(path, SCENE_TEXT.replace("11", "x" * 50_000))) < 3 * LONGEST_SHOWN
    assert len(refusal(path, f"{'k' * 500}: 1\n{SCENE_TEXT}")) < 1000
    lines = refusal(path, SCENE_TEXT.replace("[100, 200]", f"[{'-1,' * 500}]")).splitlines()
    assert len(lines) == MAX_MISTAKES + 1
    assert lines[-1].endswith(" more mistakes")


def test_a_pipe_is_no_scene(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "scene.yaml")
    with pytest.raises(InputError, match="it is not a regular file"):
        load_scene(tmp_path / "scene.yaml")
