"""Random mistakes in all inputs:  python -m tests.robustness.fuzz"""

from pathlib import Path
from typing import Annotated

import typer

from solver.instrument.errors import InputError
from solver.lab.command_end import run_command
from solver.lab.writing import prepare_output_path, write
from tests.robustness.fuzz import command
from tests.robustness.fuzz.material import prepare
from vbaa_bench.cli.options import AsJson, Workers
from vbaa_bench.report.console import console, print_line, print_result, progress_bars, show_table
from vbaa_bench.workers.resources import cores

_COUNT = typer.Option(min=0, max=10_000_000, help="number of cases")

app = typer.Typer()


@app.command()
def fuzz(
    scenes: Annotated[int, _COUNT] = 10_000,
    rigs: Annotated[int, _COUNT] = 2000,
    tables: Annotated[int, _COUNT] = 2000,
    images: Annotated[int, _COUNT] = 2000,
    predictions: Annotated[int, _COUNT] = 2000,
    records: Annotated[int, _COUNT] = 2000,
    settings: Annotated[int, _COUNT] = 2000,
    seed: Annotated[int, typer.Option(min=0, help="seed of all mistakes")] = 1,
    valid: Annotated[
        Path, typer.Option(help="folder of valid scenes, in which mistakes are made")
    ] = Path("scenes"),
    out: Annotated[
        Path | None,
        typer.Option(help="folder for cases and findings", show_default="runs/fuzz/<seed>"),
    ] = None,
    page: Annotated[Path | None, typer.Option(help="Markdown file to write")] = None,
    workers: Workers = None,
    as_json: AsJson = False,
) -> None:
    """Make random mistakes in all kinds of input, and check that each is accepted or refused.

    Each case runs in a watched process: an error without a clear sentence, a hang, too much memory
    or a file written elsewhere is a finding. The exit status is 1 if there is any. Run it again to
    continue an interrupted run.
    """
    counts = {
        "scenes": scenes,
        "rigs": rigs,
        "tables": tables,
        "images": images,
        "predictions": predictions,
        "records": records,
        "settings": settings,
    }
    folder = (out or Path("runs/fuzz") / str(seed)).resolve()
    if not any(valid.rglob("*.yaml")):
        raise InputError(f"{valid}: holds no scene (*.yaml)")
    if page:
        prepare_output_path(page)
    with console.status("making a small dataset"):
        prepare(folder / "material", valid)
    with progress_bars() as bars:
        tasks = {kind: bars.add_task(kind, total=count) for kind, count in counts.items() if count}
        try:
            record = command.fuzz(
                counts,
                seed,
                folder / "material",
                folder,
                workers or cores(),
                lambda kind, done: bars.update(tasks[kind], completed=done),
            )
        except KeyboardInterrupt:
            console.print("interrupted; the same command continues")
            raise
    if page:
        write(page, command.markdown(record).encode())
    if as_json:
        print_result(record, "", True)
    else:
        show_table(f"fuzz, seed {seed}", command.HEADS, command.rows(record))
        if record["findings"]:
            print_line(f"{record['findings']} findings in {folder / 'findings'}")
    if record["findings"]:
        raise typer.Exit(1)


if __name__ == "__main__":
    run_command(app)
