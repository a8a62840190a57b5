"""Exports in the hands of the client libraries:  python -m tests.robustness.export_clients DATASET

The first call installs datasets, webdataset, mlcroissant, PyTorch and LeRobot, 6 GB.
"""

from pathlib import Path
from typing import Annotated

import typer

from solver.lab.command_end import run_command
from solver.lab.writing import prepare_output_path, write
from tests.robustness.export_clients.command import as_markdown, check_exports
from vbaa_bench.cli.options import AsJson
from vbaa_bench.report.console import console, print_result, progress_bars

app = typer.Typer()


@app.command()
def export_clients(
    datasets: Annotated[list[Path], typer.Argument(help="dataset or collection folders")],
    environments: Annotated[
        Path, typer.Option(help="folder of the environments of the client libraries")
    ] = Path("runs/.clients"),
    out: Annotated[Path, typer.Option("--out", "-o", help="Markdown table to write")] = Path(
        "results/production/exports.md"
    ),
    as_json: AsJson = False,
) -> None:
    """Check exports with the client libraries themselves, in environments of their own, offline."""
    prepare_output_path(out)
    with progress_bars() as bars:
        tasks = {name: bars.add_task(name, total=None) for name in ("environments", "exports")}
        rows = check_exports(
            datasets,
            environments,
            lambda step, done, total: bars.update(tasks[step], completed=done, total=total),
        )
    write(out, as_markdown(rows).encode())
    wrong = [row for row in rows if not row.right]
    for row in wrong:
        console.print(f"{row.dataset}, {row.client}, {row.asked}: {row.measured}", markup=False)
    record = {"table": str(out), "checks": len(rows), "wrong": len(wrong)}
    print_result(record, f"{len(rows) - len(wrong)} of {len(rows)} checks are right", as_json)
    if wrong:
        raise typer.Exit(1)


if __name__ == "__main__":
    run_command(app)
