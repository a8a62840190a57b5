"""Tracing of public images of cables, against their labels:  python -m results.tracing FOLDER"""

import math
from pathlib import Path
from typing import Annotated

import typer
from rich.progress import track

from results.tracing.measure import cases, figures, ridge_score, trace_score
from solver.lab.command_end import run_command
from solver.lab.console import console

app = typer.Typer()


@app.command()
def tracing(
    folder: Annotated[Path, typer.Argument(help="folder dataset/ of a copy of mBEST")],
    odd: Annotated[
        bool, typer.Option("--odd", help="images with odd numbers, not used in development")
    ] = False,
) -> None:
    """Print coverage, errors and speed of solver.trace and of a plain ridge detector."""
    every = list(cases(folder, odd))
    trace_score(every[0])  # compiles
    shown = not console.is_terminal
    both = [
        (trace_score(case), ridge_score(case))
        for case in track(every, "tracing", console=console, transient=True, disable=shown)
    ]
    columns = {
        "solver.trace": figures(pair[0] for pair in both),
        "ridge": figures(pair[1] for pair in both),
    }
    names = list(columns["ridge"])
    print(f"| | {' | '.join(names)} |\n|---|{'---:|' * len(names)}")
    for name, values in columns.items():
        print(f"| {name} | {' | '.join(_shown(value) for value in values.values())} |")
    for case, (score, _) in zip(every, both, strict=True):
        if score.message or score.coverage < 0.5:
            print(f"- {case.name}: {score.message or f'{100 * score.coverage:.0f} % covered'}")


def _shown(value: float) -> str:
    """Format three digits, or a number without a fraction."""
    if math.isnan(value):  # a detector without sigmas
        return ""
    return f"{value:.0f}" if value > 100 else f"{value:.3g}"


if __name__ == "__main__":
    run_command(app)
