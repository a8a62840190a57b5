"""Damaged files of a dataset:  python -m tests.robustness.damage DATASET"""

from pathlib import Path
from typing import Annotated

import polars as pl
import typer

from solver.lab.command_end import run_command
from solver.lab.writing import prepare_output_path, write
from tests.robustness.damage import page
from tests.robustness.damage.trials import run_trials
from vbaa_bench.cli.options import AsJson, DatasetPath, Workers
from vbaa_bench.report.console import print_result, progress_bars, show_table
from vbaa_bench.workers.resources import cores

app = typer.Typer()


@app.command()
def damage(
    dataset: DatasetPath,
    trials: Annotated[int, typer.Option(min=1, help="number of damaged files")] = 1000,
    seed: Annotated[int, typer.Option(min=0, help="seed of the damages")] = 1,
    work: Annotated[
        Path | None,
        typer.Option(help="folder for copies of the dataset", show_default="runs/damage_trials"),
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="Markdown file to write, and a CSV file beside it")
    ] = None,
    workers: Workers = None,
    as_json: AsJson = False,
) -> None:
    """Damage files of a solved, scored dataset, on a copy: is each named, is none used silently?

    The exit status is 1 if `verify` misses a damage, or if a command uses a damaged file.
    """
    if out:
        prepare_output_path(out)
    folder = work or Path("runs/damage_trials")
    with progress_bars() as bars:
        task = bars.add_task("trials", total=trials)
        done = run_trials(
            dataset,
            folder,
            trials,
            seed,
            workers or cores(),
            lambda number, _total: bars.update(task, completed=number),
        )
    if out:
        options = f"{dataset} --trials {trials} --seed {seed} --out {out}"
        text = page.markdown(done, f"python -m tests.robustness.damage {options}")
        write(out, text.encode())
        write(out.with_suffix(".csv"), pl.DataFrame(page.rows(done)).write_csv().encode())
    commands = page.command_rows(done)
    if as_json:
        record = {"rows": page.rows(done), "commands": commands, "passed": page.passed(done)}
        print_result(record, "", True)
    else:
        named = sum(trial.named for trial in done)
        heads = tuple(commands[0])
        cells = [tuple(str(row[head]) for head in heads) for row in commands]
        show_table(f"{named} of {trials} damages named by verify", heads, cells)
    if not page.passed(done):
        raise typer.Exit(1)


if __name__ == "__main__":
    run_command(app)
