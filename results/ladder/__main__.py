"""Where the paper's 2 % went: errors from its method to the limit.  python -m results.ladder"""

from pathlib import Path
from typing import Annotated

import polars as pl
import typer

from results.ladder.measure import Row, count_frames, measure
from results.ladder.picture import png
from solver.lab.command_end import run_command
from solver.lab.writing import prepare_output_path, write
from vbaa_bench.cli.options import AsJson
from vbaa_bench.report.console import print_result, progress_bars, show_table

HEADS = ("dataset", "rung", "median", "RMSE, % of L", "divides by", "share, %")

app = typer.Typer()


@app.command()
def ladder(
    datasets: Annotated[
        list[Path], typer.Argument(help="datasets or collections of Fig. 8, with limits")
    ],
    out: Annotated[
        Path | None, typer.Option(help="folder for ladder.csv, and ladder.png of the first one")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Measure the error of x_c from the paper's method to the information limit, rung by rung."""
    if out:
        prepare_output_path(out / "ladder.csv")
    with progress_bars() as progress:
        task = progress.add_task("estimating", total=count_frames(datasets))
        ladders = [measure(root, lambda: progress.advance(task)) for root in datasets]
    rows = [row for one in ladders for row in one.rows()]
    table = pl.DataFrame(rows, infer_schema_length=None).fill_nan(None)
    if out:
        write(out / "ladder.csv", table.write_csv(float_precision=6).encode())
        write(out / "ladder.png", png(ladders[0]))
    if as_json:
        print_result({"rungs": table.to_dicts()}, "", True)
    else:
        show_table("ladder", HEADS, map(_cells, rows))


def _cells(row: Row) -> tuple[str, ...]:
    """Format a row for a table with HEADS."""
    return (
        row["dataset"],
        row["rung"],
        f"{row['x_c_median_abs_pct_L']:.2g}",
        f"{row['x_c_rmse_pct_L']:.3g}",
        f"{row['divides_by']:.2g}",
        f"{row['share_pct']:.0f}",
    )


if __name__ == "__main__":
    run_command(app)
