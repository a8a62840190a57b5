"""The command line `vbaa-bench`: all commands in the order of its help, and the exit status."""

import importlib.metadata
import sys
import warnings
from typing import Annotated, Any, Final

import typer
import typer.core

from solver.instrument.errors import InputError
from solver.lab.command_end import run_command
from vbaa_bench.cli import checks, data, datasets, measure, regression, results
from vbaa_bench.cli.export import export
from vbaa_bench.cli.interrupt import heed_interrupts
from vbaa_bench.cli.limits import limits
from vbaa_bench.cli.speed import speed
from vbaa_bench.cli.view import view
from vbaa_bench.generation.job import WorkerDiedError

# Commands of before, and where they are now.
MOVED: Final = {
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


class _Commands(typer.core.TyperGroup):
    """The commands; a name of before is refused with the one of now."""

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """Find a command by its name. Raises InputError for one that is elsewhere now."""
        if cmd_name in MOVED:
            raise InputError(f"{cmd_name} is no command any more: use {MOVED[cmd_name]}")
        return super().get_command(ctx, cmd_name)


app = typer.Typer(
    cls=_Commands, add_completion=False, no_args_is_help=True, pretty_exceptions_enable=False
)
app.command()(results.run)
app.command()(data.preview)
app.command()(data.plan)
app.command()(data.generate)
app.command()(data.merge)
app.command()(datasets.verify)
app.command()(export)
app.command()(datasets.info)
app.command()(datasets.subset)
app.command()(limits)
app.command()(results.solve)
app.command()(results.score)
app.command()(results.report)
app.command()(view)
app.command()(results.table)
app.command()(results.dictionary)
app.command()(regression.baseline)
app.command()(regression.compare)
app.command()(checks.check_method)
app.command()(measure.budget)
app.command()(measure.stability)
app.command()(measure.stress)
app.command()(checks.leaks)
app.command()(checks.doctor)
app.command()(speed)


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
