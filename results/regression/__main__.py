"""False alarms and detected changes of `compare`:  python -m results.regression RUNS"""

from pathlib import Path
from typing import Annotated

import typer

from results.regression.alarms import HEADS, lines, measure
from solver.lab.command_end import run_command
from vbaa_bench.cli.options import AsJson
from vbaa_bench.report.console import console, print_result, show_table

app = typer.Typer()


@app.command()
def alarms(
    runs: Annotated[list[Path], typer.Argument(help="scored runs of one scene, unchanged methods")],
    as_json: AsJson = False,
) -> None:
    """Count the false alarms of `compare` between runs, and how often it finds known changes.

    The runs may differ in the seed, or repeat the same images. Changes are errors that are 2 %
    larger, and times that are 30 % longer, one method at a time.
    """
    with console.status("comparing all pairs of runs"):
        record = measure(runs)
    if as_json:
        print_result(record, "", True)
    else:
        show_table(f"{record['title']}: {record['runs']} runs", HEADS, lines(record))


if __name__ == "__main__":
    run_command(app)
