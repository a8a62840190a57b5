"""Commands as pages and scripts write them, read by the command lines that they call."""

import importlib
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import typer
from typer._click.exceptions import ClickException

from solver.instrument.errors import InputError
from solver.lab.command_line import app as antenna
from vbaa_bench.cli.main import app as product

ROOT = Path(__file__).parents[1]


class Call(NamedTuple):
    """Call of a command line, with the words after its name."""

    app: typer.Typer
    words: list[str]

    def mistake(self) -> str:
        """Say what the command line refuses, without running anything; "" for nothing."""
        try:
            _parse(typer.main.get_command(self.app), self.words)
        except typer.Exit:  # --help
            return ""
        except ClickException as error:
            return f"{shlex.join(self.words)}: {error.format_message()}"
        except InputError as error:
            # Folders that earlier commands of a page make are not here.
            made = any(word.startswith("runs/") and word in str(error) for word in self.words)
            return "" if made else f"{shlex.join(self.words)}: {error}"
        missing = [
            word
            for word in self.words
            if word.startswith(("scenes/", "results/"))
            and "$" not in word
            and not (ROOT / word).exists()
        ]
        return f"{missing} does not exist" if missing else ""


def calls(script: str) -> Iterator[Call]:
    """Find the calls of vbaa-bench, of the antenna and of the laboratory in lines of a shell."""
    for line in script.replace("\\\n", " ").splitlines():
        words = shlex.split(line.strip(), comments=True)
        words = words[: words.index(">")] if ">" in words else words
        program = words[0].removeprefix(".venv/bin/") if words else ""
        if program == "vbaa-bench":
            yield Call(product, words[1:])
        elif program == "python" and words[1] == "-m":
            yield _of_module(words[2], words[3:])


def _of_module(module: str, words: list[str]) -> Call:
    """Return the call of a module; without a command, the antenna solves."""
    if module == "solver":
        names = typer.main.get_command(antenna).commands  # type: ignore[attr-defined]
        return Call(antenna, words if words[0] in (*names, "--help") else ["solve", *words])
    at = f"{module}.__main__" if (ROOT / Path(*module.split("."))).is_dir() else module
    return Call(importlib.import_module(at).app, words)


def _parse(command: Any, words: list[str], parent: Any = None) -> None:
    """Parse the words of a command, or of a command of its group. Raises ClickException."""
    if not hasattr(command, "commands"):
        # The value of a shell's variable is not known: only the names of options can be checked.
        if any("$" in word for word in words):
            known = {name for one in command.params for name in (*one.opts, *one.secondary_opts)}
            words = [word for word in words if word.startswith("-") and word not in known]
            if not words:
                return
        command.make_context(command.name, list(words), parent=parent)
        return
    context = command.make_context(command.name, list(words), parent=parent)
    _, inner, rest = command.resolve_command(context, [*context._protected_args, *context.args])
    _parse(inner, rest, context)
