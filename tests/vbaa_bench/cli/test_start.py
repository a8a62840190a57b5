"""The command's start: what it imports, its version, and a mistyped command."""

import importlib.metadata
import json
import os
import re
import runpy
import subprocess
import sys
import sysconfig
from pathlib import Path
from typing import Any

import pytest
import typer
from typer.testing import CliRunner

from solver.centreline.extractors import EXTRACTORS
from solver.instrument.errors import InputError
from solver.lab.command_line import app as antenna
from solver.methods import METHODS
from tests.command_line import CommandLine
from vbaa_bench import cli
from vbaa_bench.cli import options
from vbaa_bench.cli.main import MOVED
from vbaa_bench.scene.shipped import find_scene
from vbaa_bench.scoring.isolation import runs

# Importing these takes tenths of a second to seconds. Typer itself brings pydantic.
SLOW = {"cv2", "drjit", "mitsuba", "numba", "numpy", "polars", "scipy"}
SLOW |= {"trimesh", "vl_convert", "ruamel", "OpenEXR"}

ROOT = Path(__file__).parents[3]

STARTING = """
import json, os, signal, sys

before = dict(os.environ), signal.getsignal(signal.SIGINT)
import vbaa_bench
dir(vbaa_bench)
if sys.argv[1:]:
    from vbaa_bench.cli import main
    try:
        main()
    except SystemExit as ended:
        assert not ended.code
assert (dict(os.environ), signal.getsignal(signal.SIGINT)) == before
print(json.dumps(sorted({name.partition(".")[0] for name in sys.modules})))
"""


@pytest.mark.parametrize("words", [[], ["--help"], ["--version"], ["generate", "--help"]], ids=str)
def test_a_start_imports_nothing_slow_and_changes_nothing(words: list[str]) -> None:
    done = subprocess.run(
        [sys.executable, "-c", STARTING, *words],
        capture_output=True,
        text=True,
        check=False,
        env=os.environ | {"COLUMNS": "80"},
    )
    assert done.returncode == 0, done.stderr
    assert not SLOW & set(json.loads(done.stdout.splitlines()[-1]))


def test_names_in_help_texts_are_those_of_the_code() -> None:
    assert tuple(METHODS) == options.METHODS
    assert tuple(EXTRACTORS) == options.CENTRELINES
    assert options.MEMORY_GB == runs.MEMORY_GB


def test_the_version_is_that_of_the_package() -> None:
    done = CliRunner().invoke(cli.app, ["--version"])
    assert (done.exit_code, done.stdout) == (0, importlib.metadata.version("vbaa-bench") + "\n")


def test_the_package_runs_as_a_module(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["vbaa-bench", "--version"])
    with pytest.raises(SystemExit) as ended:
        runpy.run_module("vbaa_bench", run_name="__main__")
    assert not ended.value.code
    assert capsys.readouterr().out == importlib.metadata.version("vbaa-bench") + "\n"


def test_a_mistyped_command_gets_a_suggestion() -> None:
    done = CliRunner().invoke(cli.app, ["generat", "scene.yaml"])
    assert done.exit_code == 2
    assert "Did you mean 'generate'?" in done.stderr


def test_a_command_of_before_says_where_it_is_now() -> None:
    group: Any = typer.main.get_command(cli.app)
    commands = group.commands
    for name, home in MOVED.items():
        done = CliRunner().invoke(cli.app, [name, "--help"])
        assert name not in commands
        assert str(done.exception) == f"{name} is no command any more: use {home}"
        first, *words = home.split(",")[0].split()
        if first == "python":
            module = ROOT.joinpath(*words[1].split("."))
            assert (module / "__main__.py").is_file() or module.with_suffix(".py").is_file()
        else:
            known = {option for one in commands[first].params for option in one.opts}
            assert {word for word in words if word.startswith("-")} <= known, home


def test_pages_name_commands_that_exist() -> None:
    group: Any = typer.main.get_command(cli.app)
    pages = [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"), *(ROOT / "scenes").rglob("*.md")]
    pages += (ROOT / "results").rglob("*.md")
    for path in pages:
        called = re.findall(
            r"(?:`|bin/|^ *)vbaa-bench ([a-z][a-z-]*)", path.read_text("utf-8"), re.M
        )
        assert set(called) <= group.commands.keys(), path
    assert "view" in called or len(pages) > 20


def test_every_command_shows_an_example_with_options_that_exist() -> None:
    group: Any = typer.main.get_command(cli.app)
    # More cannot be overlooked in a help.
    assert len(group.commands) <= 22
    for name, command in leaves(group).items():
        program, *words = command.epilog.removeprefix("Example: ").split()
        assert program == "vbaa-bench"
        assert " ".join(words).startswith(f"{name} ") or words == [name]
        known = {option for one in command.params for option in one.opts}
        assert "--json" in known, name
        assert {word for word in words if word.startswith("-")} <= known, name
        if name in {"run", "generate", "limits", "stress", "view"}:
            find_scene(words[1])


@pytest.mark.parametrize("app", [cli.app, antenna], ids=["vbaa-bench", "solver"])
def test_help_has_types_and_defaults_in_words(app: typer.Typer) -> None:
    group: Any = typer.main.get_command(app)
    groups: list[list[str]] = [[], ["suite"]] if app is cli.app else [[]]
    for words in (*groups, *(name.split() for name in leaves(group))):
        text = CliRunner().invoke(app, [*words, "--help"], env={"COLUMNS": "200"}).stdout
        assert "Show this message" in text
        assert not re.search(r"\[default|<(bool|str|list|int|float|path)\b", text), words


def test_defaults_in_help_are_sentences() -> None:
    text = CliRunner().invoke(cli.app, ["run", "--help"], env={"COLUMNS": "200"}).stdout
    assert "folder to write; default: runs/SCENE" in text
    assert "median time is used; default: 3 " in text


def leaves(group: Any, prefix: str = "") -> dict[str, Any]:
    """Commands by the words that call them, such as `suite run`."""
    found: dict[str, Any] = {}
    for name, command in group.commands.items():
        is_group = hasattr(command, "commands")
        inner = leaves(command, f"{prefix}{name} ") if is_group else {f"{prefix}{name}": command}
        found |= inner
    return found


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["info", "nowhere"], "nowhere: is not a dataset"),
        (["generate", "x.yaml", "--frames", "0"], "--frames"),
        (["infos"], "Did you mean 'info'?"),
        (["table"], "Missing argument"),
    ],
)
def test_what_is_wrong_is_one_json_object_for_a_script(
    words: list[str], said: str, capfd: pytest.CaptureFixture[str]
) -> None:
    ended = CommandLine(cli.main, capfd)(*words, "--json")
    assert (ended.status, ended.err) == (2, "")
    assert said in json.loads(ended.out)["error"]


@pytest.mark.parametrize(
    "words",
    [
        ["view"],
        ["limits"],
        ["compare", "."],
        ["compare", "--save", "."],
        ["check-method", "exact_fit"],
        ["export", ".", "--to", "csv", "--out"],
    ],
    ids=" ".join,
)
def test_a_name_that_is_too_long_is_one_sentence(words: list[str]) -> None:
    done = CliRunner().invoke(cli.app, [*words, 300 * "a"])
    assert isinstance(done.exception, InputError)
    assert "is not a file or folder name (File name too long)" in str(done.exception)


def test_the_schema_is_a_page_or_an_object() -> None:
    runner = CliRunner()
    page = runner.invoke(cli.app, ["schema", "columns"]).stdout
    assert page == (ROOT / "docs" / "data_dictionary.md").read_text(encoding="utf-8")
    files = json.loads(runner.invoke(cli.app, ["schema", "columns", "--json"]).stdout)
    column = files["predictions/METHOD.csv"]["x_c_mm"]
    assert (column["unit"], set(column)) == ("mm", {"unit", "frame", "meaning", "null"})
    page = runner.invoke(cli.app, ["schema", "format"]).stdout
    assert json.loads(runner.invoke(cli.app, ["schema", "format", "--json"]).stdout) == {
        "page": page
    }
    assert "columns" in runner.invoke(cli.app, ["schema"]).stderr


def test_a_shell_completes_commands_options_and_values() -> None:
    def completed(words: str, count: int) -> list[str]:
        completion = {"COMP_WORDS": f"vbaa-bench {words}", "COMP_CWORD": str(count)}
        done = subprocess.run(
            [Path(sysconfig.get_path("scripts")) / "vbaa-bench"],
            env=os.environ | {"_VBAA_BENCH_COMPLETE": "complete_bash"} | completion,
            capture_output=True,
            text=True,
            check=True,
        )
        return done.stdout.split()

    assert completed("ver", 1) == ["verify"]
    assert completed("verify --le", 2) == ["--leaks"]
    assert completed("schema ", 2) == ["columns", "format", "scene"]
    assert completed("export set --to web", 4) == ["webdataset"]


def test_a_misspelled_method_is_refused_before_anything_is_rendered(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    said = CommandLine(cli.main, capfd).refused("run", "quickstart", "--method", "exactfit")
    assert "method 'exactfit' is unknown, allowed is one of two_point" in said
    assert list(tmp_path.iterdir()) == []
