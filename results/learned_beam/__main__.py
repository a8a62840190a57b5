"""The beam as stated and as learned:  python -m results.learned_beam DATASETS"""

from pathlib import Path
from typing import Annotated

import typer

from results.learned_beam import comparison as learning
from results.learned_beam.table import HEADS, markdown
from solver.lab.command_end import run_command
from solver.lab.writing import prepare_output_path, write
from vbaa_bench.cli.options import AsJson
from vbaa_bench.report.console import print_result, progress_bars, show_table

app = typer.Typer()


@app.command()
def check_learning(
    datasets: Annotated[list[Path], typer.Argument(help="datasets or collections of rigs")],
    pushes: Annotated[int, typer.Option(min=2, help="pushes to learn from, without splits")] = 5,
    draws: Annotated[int, typer.Option(min=1, help="times that they are drawn")] = 4,
    force_sigma_pct: Annotated[
        float | None,
        typer.Option(min=0, max=100, help="sigma of one known force", show_default="none is known"),
    ] = None,
    object_radius_mm: Annotated[
        float | None,
        typer.Option(min=0, help="radius of the touched objects", show_default="unknown"),
    ] = None,
    weights: Annotated[
        Path | None,
        typer.Option(
            help="dataset of hung weights on the same rig, one of which is the known force",
            show_default="a contact is known",
        ),
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="seed of the draws")] = 1,
    out: Annotated[Path | None, typer.Option(help="Markdown file to write")] = None,
    as_json: AsJson = False,
) -> None:
    """Compare the exact fit with the beam as stated, and as learned from other pushes."""
    if out:
        prepare_output_path(out)
    with progress_bars() as bars:
        task = bars.add_task("datasets", total=learning.count_datasets(datasets))
        results = learning.measure(
            datasets,
            pushes,
            draws,
            seed,
            force_sigma_pct,
            object_radius_mm,
            weights,
            lambda: bars.advance(task),
        )
    if out:
        options = f"--pushes {pushes} --draws {draws} --seed {seed}"
        if force_sigma_pct is not None:
            options += f" --force-sigma-pct {force_sigma_pct:g}"
        if object_radius_mm is not None:
            options += f" --object-radius-mm {object_radius_mm:g}"
        if weights is not None:
            options += f" --weights {weights}"
        names = " ".join(map(str, datasets))
        command = f"python -m results.learned_beam {names} {options} --out {out.name}"
        write(out, markdown(results, command).encode())
    if as_json:
        print_result({"results": [one.record() for one in results]}, "", True)
        return
    show_table("the exact fit", HEADS, [one.line() for one in results])


if __name__ == "__main__":
    run_command(app)
