"""The command export, on rendered frames."""

import json
from pathlib import Path

import pytest

from tests.command_line import CommandLine
from vbaa_bench import cli
from vbaa_bench.exports.format import FORMATS


@pytest.fixture
def command(capfd: pytest.CaptureFixture[str]) -> CommandLine:
    return CommandLine(cli.main, capfd)


@pytest.mark.parametrize("name", FORMATS)
def test_rendered_frames_are_exported(
    command: CommandLine, dataset: Path, tmp_path: Path, name: str
) -> None:
    ended = command("export", dataset, "--to", name, "--out", tmp_path / "out", "--json")
    assert ended.status == 0, ended
    record = json.loads(ended.out)
    assert record == {"export": str(tmp_path / "out"), "frames": 4, "splits": {"train": 4}}


def test_mistakes_are_one_sentence(command: CommandLine, dataset: Path, tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "mine").touch()
    for words, message in (
        ((dataset, "--to", "csv", "--out", tmp_path / "out"), "out: exists already"),
        ((tmp_path, "--to", "csv", "--out", tmp_path / "new"), "is not a dataset"),
        ((dataset, "--to", "hf"), "--to is hf and --out is None, allowed is a new folder"),
        ((dataset, "--to", "croissant", "--out", tmp_path / "new"), "or no --out with --to"),
    ):
        assert message in command.refused("export", *words)
    assert [path.name for path in tmp_path.iterdir()] == ["out"]
