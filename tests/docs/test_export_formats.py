"""The page on export formats: its example is a format that exports, and mistakes are sentences."""

import json
import re
import sys
from pathlib import Path

import pytest

from tests.command_line import CommandLine
from tests.vbaa_bench.exports.written import Size, write_collection, write_dataset
from vbaa_bench import cli

PAGE = Path(__file__).parents[2] / "docs" / "export_formats.md"
BLOCK = re.compile(r"```python\n(.*?)```", re.DOTALL)


@pytest.fixture
def command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> CommandLine:
    """The command, in a folder with the page's example."""
    (code,) = BLOCK.findall(PAGE.read_text(encoding="utf-8"))
    (tmp_path / "json_lines.py").write_text(code, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path])
    monkeypatch.delitem(sys.modules, "json_lines", raising=False)
    return CommandLine(cli.main, capfd)


def test_the_format_of_the_page_exports_datasets_and_collections(
    command: CommandLine, tmp_path: Path
) -> None:
    write_dataset(tmp_path / "set", Size(pushes=5), splits=["train", "test"])
    words = ("--to", "json_lines:JsonLines", "--out")
    ended = command("export", "set", *words, "out", "--json")
    assert ended.status == 0, ended
    assert json.loads(ended.out) == {
        "export": "out",
        "frames": 15,
        "splits": {"train": 9, "test": 6},
    }
    names = json.loads((tmp_path / "out" / "files.json").read_text())
    lines = [line for name in names for line in (tmp_path / "out" / name).read_text().splitlines()]
    assert len({json.loads(line)["frame_id"] for line in lines}) == 15
    card = (tmp_path / "out" / "README.md").read_text(encoding="utf-8")
    assert 'pd.read_json("train-000000.jsonl", lines=True)' in card
    write_collection(tmp_path / "rigs", [Size(), Size(pushes=2)])
    assert command("export", "rigs", *words, "both").status == 0


def test_a_format_that_loses_a_value_is_refused(command: CommandLine, tmp_path: Path) -> None:
    path = tmp_path / "json_lines.py"
    text = path.read_text(encoding="utf-8")
    path.write_text(text.replace('values.pop("key")', 'values.pop("key"); values["x_c_mm"] = 1.5'))
    write_dataset(tmp_path / "set")
    ended = command("export", "set", "--to", "json_lines:JsonLines", "--out", "out")
    assert ended.status == 2  # below the bars of progress
    assert "error: out: is not what was exported: x_c_mm of the frame" in ended.err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("coco", "the format 'coco' is unknown, allowed is one of hf, webdataset, lerobot, csv"),
        ("nowhere:Coco", "the format 'nowhere:Coco' cannot be imported: ModuleNotFoundError"),
        ("json_lines:Coco", "has no attribute 'Coco'"),
        ("json_lines:Cut", "is no subclass of vbaa_bench.exports.format.Format"),
    ],
)
def test_what_is_no_format_is_one_sentence(command: CommandLine, name: str, message: str) -> None:
    assert message in command.refused("export", ".", "--to", name, "--out", "out")
