"""The command view: formats, ranges and refusals."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from solver.instrument.errors import InputError
from tests.vbaa_bench.stored import store
from vbaa_bench.cli import app
from vbaa_bench.cli import view as module
from vbaa_bench.cli.options import parsed_range, rig_numbers
from vbaa_bench.cli.view import Format, view


@pytest.mark.parametrize(
    ("installed", "expected"),
    [
        ({"rerun", "av"}, [Format.RRD, Format.PNG]),
        ({"av"}, [Format.MP4, Format.PNG]),
        (set(), [Format.GIF, Format.PNG]),
    ],
)
def test_the_format_depends_on_what_is_installed(
    installed: set[str], expected: list[Format], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "find_spec", lambda name: name if name in installed else None)
    assert module._formats(None, None) == expected
    assert module._formats(None, Format.GIF) == [Format.GIF]
    assert module._formats(Path("a.MP4"), None) == [Format.MP4]


def test_a_wrong_suffix_is_refused() -> None:
    with pytest.raises(InputError, match=r"a.jpg: ends in 'jpg', allowed is one of rrd, mp4"):
        module._formats(Path("a.jpg"), None)
    with pytest.raises(InputError, match=r"a.gif: ends in 'gif', allowed is png"):
        module._formats(Path("a.gif"), Format.PNG)


def test_ranges_of_frames() -> None:
    assert parsed_range("7") == slice(7, 8)
    assert parsed_range("3:7") == slice(3, 7)
    assert parsed_range("3:") == slice(3, None)
    assert parsed_range(":7") == slice(0, 7)
    for text in ("", ":", "a", "-1", "1:2:3"):
        assert parsed_range(text) is None
        with pytest.raises(InputError, match=r"--frames is .*, allowed is a number or a range"):
            module._frames(text)
    assert rig_numbers(None, 5) == range(5)
    assert rig_numbers("2:", 5) == range(2, 5)
    for text in ("5", "3:6", "3:3", "4:2", "x"):
        with pytest.raises(InputError, match=f"--rigs is {text}, allowed .* within 0:5"):
            rig_numbers(text, 5)


def test_pictures_are_written_to_the_report(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(module, "find_spec", lambda _name: None)
    root = store(tmp_path / "set", frames=3)
    view(root, as_json=True)
    record = json.loads(capsys.readouterr().out)
    assert record["frames"] == 3
    assert Path(record["gif"]).read_bytes().startswith(b"GIF89a")
    assert Path(record["png"]) == root / "report" / "view.png"
    view(root, out=tmp_path / "new" / "one.png", frames="0")
    assert (tmp_path / "new" / "one.png").is_file()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--push", "a"], "is a scene, so that --push is not allowed"),
        (["--random", "3", "--frames", "3"], "nor --frames with --random"),
        (["--frames", "3:5"], "allowed for a scene is the number of one frame"),
        (["--frames", "100000"], "frame 100000 does not exist, allowed is 0 to 269"),
        (["--format", "gif"], "is a scene, drawn as png: --format is gif"),
        (["--out", "a.gif"], "a.gif: ends in 'gif', allowed is png"),
        (["--set", "beam.length=3"], "length"),
    ],
    ids=str,
)
def test_what_a_scene_does_not_have_is_refused(words: list[str], message: str) -> None:
    done = CliRunner().invoke(app, ["view", "scenes/fig8_rigid.yaml", *words])
    assert isinstance(done.exception, InputError)
    assert message in str(done.exception)


def test_what_a_dataset_does_not_have_is_refused(tmp_path: Path) -> None:
    root = store(tmp_path / "set", frames=3)
    for words in (["--random", "3"], ["--seed", "3"], ["--set", "seed=3"], ["--variant", "x"]):
        done = CliRunner().invoke(app, ["view", str(root), *words])
        assert "is not a scene, so that --random, --seed" in str(done.exception)
    missing = CliRunner().invoke(app, ["view", "nowhere.yaml"])
    assert "nowhere.yaml: is neither a file nor a shipped scene" in str(missing.exception)
