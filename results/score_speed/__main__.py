"""Speed and memory of scores and reports:  python -m results.score_speed DATASET"""

from typing import Annotated

import typer

from results.score_speed import measure as speed_scores
from solver.lab.command_end import run_command
from vbaa_bench.cli.options import AsJson, DatasetPath
from vbaa_bench.report.console import console, print_result, show_table

app = typer.Typer()


@app.command()
def scores(
    dataset: DatasetPath,
    frames: Annotated[int, typer.Option(min=1, help="number of frames")] = 100_000,
    method: Annotated[
        list[str] | None, typer.Option(help="solved method; repeatable", show_default="all")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Measure scoring and reporting of many frames, which are copies of a solved dataset's."""
    with console.status("measuring"):
        record = speed_scores.measure(dataset, frames, method or ())
    if as_json:
        print_result(record, "", True)
        return
    rows = [
        (stage, *(f"{value:.3g}" for value in record[stage].values()))
        for stage in speed_scores.STAGES
    ]
    title = f"{record['frames']:,} frames, {len(record['methods'])} methods"
    show_table(title, ("stage", "seconds", "processor time, s", "peak memory, GB"), rows)


if __name__ == "__main__":
    run_command(app)
