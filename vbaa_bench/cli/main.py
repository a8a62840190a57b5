"""The command line `vbaa-bench`: all commands in the order of its help, and the exit status."""

import importlib.metadata
import json
import sys
import warnings
from collections.abc import Callable
from typing import Annotated, Any, Final, NamedTuple

import typer
import typer.core
from typer.exceptions import TyperException

from solver.instrument.errors import IncompleteError, InputError
from solver.lab.command_end import run_command
from solver.lab.help import Command, Group
from vbaa_bench.cli import checks, data, datasets, measure, results
from vbaa_bench.cli.compare import compare
from vbaa_bench.cli.export import export
from vbaa_bench.cli.interrupt import heed_interrupts
from vbaa_bench.cli.limits import limits
from vbaa_bench.cli.scenes import scenes
from vbaa_bench.cli.speed import speed
from vbaa_bench.cli.suite import suite
from vbaa_bench.cli.view import view
from vbaa_bench.extra import remedy
from vbaa_bench.workers.jobs import WorkerDiedError

# Commands of before, and where they are now.
MOVED: Final = {
    "baseline": "compare RUN FILE --save",
    "dictionary": "schema columns",
    "leaks": "verify DATASET --leaks",
    "plan": "generate SCENE --plan",
    "preview": "view SCENE",
    "stability": "check-method all --stability",
    "alarms": "python -m results.regression, in the repository",
    "check-camera": "python -m results.calibration, in the repository",
    "check-learning": "python -m results.learned_beam, in the repository",
    "check-limits": "python -m results.limits, in the repository",
    "check-photographs": "python -m results.photographs, in the repository",
    "contact-sheet": "python -m results.pictures scenes, in the repository",
    "learned": "python -m results.learned, in the repository",
    "outline": "python -m results.outline, in the repository",
    "outside": "python -m results.pictures outside, in the repository",
    "remake": "python -m results.remake, in the repository",
    "check-damage": "python -m tests.robustness.damage, in the repository",
    "check-exports": "python -m tests.robustness.export_clients, in the repository",
    "endurance": "python -m tests.robustness.endurance, in the repository",
    "fuzz": "python -m tests.robustness.fuzz, in the repository",
}


class _Commands(Group):
    """The commands. A name of before is refused with the one of now, a missing extra is named."""

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """Find a command by its name. Raises InputError for one that is elsewhere now."""
        if cmd_name in MOVED:
            raise InputError(f"{cmd_name} is no command any more: use {MOVED[cmd_name]}")
        return super().get_command(ctx, cmd_name)

    def invoke(self, ctx: Any) -> Any:
        """Run a command. Raises InputError if it needs an extra that is not installed."""
        try:
            return super().invoke(ctx)
        except ModuleNotFoundError as error:
            if (sentence := remedy(error)) is None:
                raise
            raise InputError(sentence) from error


class _Command(NamedTuple):
    """A command, and an example of its use, without the program's name."""

    function: Callable[..., None]
    example: str


# The groups of the help.
_GROUPS: Final = {
    "Make datasets": (
        _Command(results.run, "run quickstart"),
        _Command(data.generate, "generate random/rigs --rigs 0:20 --out runs/rigs"),
        _Command(scenes, "scenes"),
        _Command(data.merge, "merge runs/whole runs/part_1 runs/part_2"),
        _Command(datasets.subset, "subset runs/rigs_0 runs/few --frames 40"),
        _Command(datasets.verify, "verify runs/quickstart --repair"),
        _Command(export, "export runs/quickstart --to hf --out runs/quickstart_hf"),
    ),
    "Solve and score": (
        _Command(results.solve, "solve runs/quickstart --method exact_fit --method mine:solve"),
        _Command(results.score, "score runs/quickstart --predictions mine.csv"),
        _Command(limits, "limits fig8_rigid --require x_c_pct_L=0.1"),
        _Command(checks.check_method, "check-method mine:solve"),
    ),
    "Compare methods and versions": (
        _Command(results.table, "table runs/quickstart runs/fig8_rigid --brief"),
        _Command(compare, "compare runs/quickstart quickstart.json"),
        _Command(measure.budget, "budget runs/quickstart --method exact_fit"),
        _Command(speed, "speed runs/quickstart --method exact_fit"),
        _Command(measure.stress, "stress random/rigs --rigs 10"),
    ),
    "Look at datasets and results": (
        _Command(results.report, "report runs/quickstart --baseline quickstart.json"),
        _Command(view, "view hard/friction --frames 3 --out frame.png"),
        _Command(datasets.info, "info runs/quickstart"),
        _Command(datasets.schema, "schema columns"),
    ),
    "Help": (_Command(checks.doctor, "doctor"),),
}

app = typer.Typer(cls=_Commands, no_args_is_help=True, pretty_exceptions_enable=False)
for _group, _commands in _GROUPS.items():
    for _one in _commands:
        app.command(
            cls=Command, rich_help_panel=_group, epilog=f"Example: vbaa-bench {_one.example}"
        )(_one.function)


app.add_typer(
    suite,
    name="suite",
    help="Run a suite of the benchmark, verify its datasets, check submissions, rank methods.",
    rich_help_panel="Compare methods and versions",
)


def _print_version(requested: bool) -> None:
    if requested:
        print(importlib.metadata.version("vbaa-bench"))
        raise typer.Exit


@app.callback()
def options(
    _version: Annotated[
        bool,
        typer.Option("--version", is_eager=True, callback=_print_version, help="show the version"),
    ] = False,
) -> None:
    """Benchmark vision-based active antennas: render datasets, solve them, score methods."""


def main() -> None:
    """Run the command line, and exit as `run_command` does; with 1 if a worker process died.

    Errors are printed as one message.
    """
    heed_interrupts()
    run_command(_run)


def _run() -> None:
    # Polars warns, and the process is then killed by an illegal instruction.
    warnings.filterwarnings("error", "Missing required CPU features", RuntimeWarning)
    try:
        if "--json" in sys.argv[1:]:
            _with_errors_as_json()
        app()
    except RuntimeWarning as error:
        if "CPU features" not in str(error):
            raise
        raise InputError(
            "polars needs instructions that this processor lacks, such as AVX2: "
            "pip install 'polars[rtcompat]'"
        ) from error
    except WorkerDiedError as error:
        print(f"error: {error}", file=sys.stderr)
        sys.exit(1)


def _with_errors_as_json() -> None:
    """Run the command; print what is wrong as one JSON object on stdout, with the same status."""
    try:
        status = app(standalone_mode=False)
    except typer.Abort:
        raise KeyboardInterrupt from None
    except (InputError, TyperException) as error:
        text = error.format_message() if isinstance(error, TyperException) else str(error)
        print(json.dumps({"error": text}))
        sys.exit(1 if isinstance(error, IncompleteError) else 2)
    sys.exit(status)
