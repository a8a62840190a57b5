"""Speed and error of the mechanics:  python -m results.mechanics"""

from typing import Annotated

import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from results.mechanics import measure as speed_mechanics
from solver.lab.command_end import run_command
from vbaa_bench.cli.options import AsJson
from vbaa_bench.report.console import console, print_result

app = typer.Typer()


@app.command()
def mechanics(
    yardstick_seconds: Annotated[
        float, typer.Option(min=1, help="seconds for PyElastica to reach equilibrium")
    ] = 60,
    as_json: AsJson = False,
) -> None:
    """Measure equilibria per second on one core and their error; PyElastica too, if installed."""
    with console.status("measuring on one core"):
        record = speed_mechanics.measure_apart(yardstick_seconds)
    if as_json:
        print_result(record, "", True)
        return
    table = Table(title="one core; ratio to PyElastica; maximum error", title_justify="left")
    for head in ("model", "states/s", "ratio", "error"):
        first = head == "model"
        table.add_column(head, justify="left" if first else "right", no_wrap=True)
    table.add_column("remark", overflow="fold")
    for row in speed_mechanics.rows(record):
        table.add_row(*map(escape, row))
    Console().print(table)


if __name__ == "__main__":
    run_command(app)
