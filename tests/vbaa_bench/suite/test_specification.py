"""Suites: every shipped one is valid, and mistakes get sentences."""

import re
from pathlib import Path

import pytest
from ruamel.yaml import YAML

from solver.instrument.errors import InputError
from solver.instrument.files import sha256
from tests.vbaa_bench.suite.small import write_suite
from vbaa_bench.scene.frames import Frames
from vbaa_bench.scene.shipped import frozen_frames, shipped_suites
from vbaa_bench.suite.frozen import read_frozen
from vbaa_bench.suite.specification import load_suite


@pytest.mark.parametrize("name", [path.stem for path in shipped_suites()])
def test_a_shipped_suite_fixes_scenes_that_exist(name: str) -> None:
    suite = load_suite(name)
    # Scenes of random rigs take seconds to draw.
    entries = [entry for entry in suite.entries() if entry.dataset.rigs is None]
    for entry in entries:
        file = suite.scene(entry)
        assert Frames(file.scene).count == entry.dataset.frames
        splits = file.scene.splits
        assert entry.dataset.split in ((None,) if splits is None else splits.shares)
    rigs = [entry.dataset.rigs or 0 for entry in suite.entries(("random",))]
    assert sum(rigs) == 100
    assert read_frozen(suite).keys() <= {entry.key for entry in suite.entries()}


@pytest.fixture
def suite(tmp_path: Path, small_scene: Path, variant: str) -> Path:
    return write_suite(tmp_path, small_scene, variant)


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("frames: 4", "frame: 4", r"pushes\.frame is an unknown key; did you mean frames\?"),
        ("about: Four", "abot: Four", r"tracks\.one\.abot is an unknown key"),
        ("repeats: 1", "repeats: many", r"rules\.repeats is 'many', allowed is a whole number"),
        ("frame_limit_s: 60", "frame_limit_s: 90", "is 90, allowed is 60, which this version"),
        ("min_loads: 20", "min_loads: 5", "real.min_loads is 5, allowed is 20, which this version"),
        ("[error_pct_L, ", "[errors, ", "metrics holds 'errors', allowed is one of error_pct_L"),
        ("[error_pct_L, ", "[", "metrics holds no error_pct_L, by which methods are ranked"),
        ("  one:", "  One!:", r"One!"),
        ("version: small", "version: other", "version is other, allowed is the file name small"),
    ],
)
def test_a_mistake_in_a_suite_is_one_sentence(
    suite: Path, old: str, new: str, sentence: str
) -> None:
    text = suite.read_text(encoding="utf-8")
    assert old in text
    suite.write_text(text.replace(old, new), encoding="utf-8")
    with pytest.raises(InputError, match=sentence) as error:
        load_suite(str(suite))
    assert str(error.value).startswith(str(suite))


def test_a_scene_that_is_not_as_the_suite_states_is_refused(suite: Path) -> None:
    text = suite.read_text(encoding="utf-8")
    suite.write_text(text.replace("frames: 4", "frames: 5"), encoding="utf-8")
    loaded = load_suite(str(suite))
    (entry,) = loaded.entries()
    with pytest.raises(InputError, match=r"one\.datasets\.pushes\.frames is 5, allowed is 4, the"):
        loaded.scene(entry)
    suite.write_text(text.replace("frames: 4", "frames: 4, rigs: 2"), encoding="utf-8")
    loaded = load_suite(str(suite))
    (entry,) = loaded.entries()
    with pytest.raises(InputError, match=r"pushes\.rigs is 2, allowed is nothing, as in"):
        loaded.scene(entry)


def test_an_unknown_suite_or_track_is_refused_with_those_that_exist(suite: Path) -> None:
    with pytest.raises(InputError, match=r"suite 'x' is unknown, allowed is .*1\.0"):
        load_suite("x")
    with pytest.raises(InputError, match="track 'papers' is unknown, allowed is one of one"):
        load_suite(str(suite)).entries(("papers",))


def test_the_citation_has_the_digests_of_the_suites() -> None:
    root = Path(__file__).parents[3]
    citation = YAML(typ="safe").load((root / "CITATION.cff").read_text(encoding="utf-8"))
    stated = {one["value"]: one["description"] for one in citation["identifiers"]}
    files = [path for suite in shipped_suites() for path in (suite, frozen_frames(suite))]
    for path in files:
        name = path.relative_to(root).as_posix()
        assert name in stated[f"sha256:{sha256(path)}"]
    assert len(stated) == len(files)


def test_rules_on_the_page_are_those_of_the_suite() -> None:
    root = Path(__file__).parents[3]
    page = (root / "docs" / "suite.md").read_text(encoding="utf-8")
    content = load_suite("1.0").content
    listed = dict(re.findall(r"^\| `(\w+)` \| ([\d,]+) \|", page, re.MULTILINE))
    assert {name: int(count.replace(",", "")) for name, count in listed.items()} == {
        name: sum(one.frames * (one.rigs or 1) for one in track.datasets.values())
        for name, track in content.tracks.items()
    }
    rules = content.rules
    for number in (f"{rules.frame_limit_s:g} s", f"{rules.memory_gb:g} GB"):
        assert number in page
