"""The command view: formats, ranges and refusals."""

import json
from pathlib import Path

import pytest

from solver.instrument.errors import InputError
from tests.vbaa_bench.stored import store
from vbaa_bench.cli import view as module
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
    assert module._range("7") == slice(7, 8)
    assert module._range("3:7") == slice(3, 7)
    assert module._range("3:") == slice(3, None)
    assert module._range(":7") == slice(0, 7)
    for text in ("", ":", "a", "-1", "1:2:3"):
        with pytest.raises(InputError, match=r"--frames is .*, allowed is a number or a range"):
            module._range(text)


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
