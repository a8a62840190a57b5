"""A regressor that learns from one dataset:  python -m results.learned TRAIN OTHERS"""

from pathlib import Path
from typing import Annotated

import typer

from results.learned import regressor
from solver.lab.command_end import run_command
from solver.lab.writing import prepare_output_path, write
from vbaa_bench.cli.options import AsJson, DatasetPath
from vbaa_bench.report.console import print_result, progress_bars, show_table

app = typer.Typer()


@app.command()
def learned(
    train: DatasetPath,
    others: Annotated[
        list[Path] | None, typer.Argument(help="folders of other datasets", show_default="none")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Markdown file to write")] = None,
    predictions: Annotated[
        bool, typer.Option("--predictions", help="also write predictions/learned.csv, to be scored")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Train a regressor on one dataset; measure its errors there and on other datasets.

    Its errors on held-out frames are listed beside those of a constant and of exact_fit, if solved.
    Needs the extra 'learned'.
    """
    if out:
        prepare_output_path(out)
    with progress_bars() as progress:
        task = progress.add_task("training", total=regressor.FOLDS)
        record = regressor.measure(
            train, others or (), lambda: progress.advance(task), with_predictions=predictions
        )
    if out:
        write(out, regressor.markdown(record).encode())
    if as_json:
        print_result(record, "", True)
        return
    title = f"trained on {record['training_frames']} frames of {record['train']}"
    show_table(title, regressor.HEADS, regressor.cells(record))


if __name__ == "__main__":
    run_command(app)
