"""What the share of consistent frames owes to the thresholds of a right refusal.

python -m results.random DATASETS
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Final

import polars as pl
import typer

from solver.lab.command_end import run_command
from solver.lab.writing import prepare_output_path, write
from vbaa_bench.cli.options import AsJson
from vbaa_bench.dataset.collection import CollectionLayout, is_collection
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.dataset.readers import Truth, open_truth
from vbaa_bench.report.console import print_result, show_table
from vbaa_bench.scoring.frame_scores import score_frames, true_frames
from vbaa_bench.scoring.predictions import read_predictions
from vbaa_bench.scoring.refusals import THRESHOLDS, Thresholds
from vbaa_bench.scoring.results_layout import Results
from vbaa_bench.scoring.score import found_predictions

# Each threshold is multiplied by these; 0 excuses no refusal for its sake.
FACTORS: Final = (0.0, 0.5, 1.0, 2.0)
HEADS: Final = ("dataset", "method", "threshold", *(f"x {factor:g}" for factor in FACTORS))


def varied(name: str, factor: float) -> Thresholds:
    """Multiply one threshold, or all of them, by a factor."""
    names = Thresholds._fields if name == "all" else (name,)
    return THRESHOLDS._replace(**{one: factor * getattr(THRESHOLDS, one) for one in names})


def consistent_shares(datasets: list[Path], methods: list[str]) -> pl.DataFrame:
    """Compute the consistent frames in % for each factor of each threshold: one row per threshold.

    A collection counts as one dataset. Raises InputError.
    """
    rows = []
    for root in datasets:
        rigs = [(layout, open_truth(layout.truth, centrelines=False)) for layout in _rigs(root)]
        for method in methods:
            for name in (*Thresholds._fields, "all"):
                shares = [_share(rigs, method, varied(name, factor)) for factor in FACTORS]
                rows.append((root.name, method, name, *shares))
    return pl.DataFrame(rows, schema=HEADS, orient="row")


def _rigs(root: Path) -> Iterator[Layout]:
    yield from CollectionLayout(root).rigs().values() if is_collection(root) else [Layout(root)]


def _share(rigs: list[tuple[Layout, Truth]], method: str, thresholds: Thresholds) -> float:
    """Compute the share of consistent frames of all rigs, in %; a rig not solved does not count."""
    consistent = pl.concat(
        score_frames(
            truth, read_predictions(path), method, str(path), true=true_frames(truth, thresholds)
        )["consistent"]
        for layout, truth in rigs
        if (path := found_predictions(Results(layout.root)).get(method)) is not None
    )
    return 100 * float(consistent.cast(pl.Float64).mean() or 0.0)  # type: ignore[arg-type]  # of numbers


app = typer.Typer()


@app.command()
def main(
    datasets: Annotated[list[Path], typer.Argument(help="solved datasets or collections")],
    method: Annotated[list[str] | None, typer.Option(help="repeatable")] = None,
    out: Annotated[Path | None, typer.Option(help="CSV to write")] = None,
    as_json: AsJson = False,
) -> None:
    """Multiply the thresholds of a right refusal, and count the consistent frames in %."""
    if out:
        prepare_output_path(out)
    table = consistent_shares(datasets, method or ["exact_fit"])
    if out:
        write(out, table.write_csv(float_precision=2).encode())
    if as_json:
        print_result({"rows": table.to_dicts()}, "", True)
        return
    rows = [(*row[:3], *(f"{share:.1f}" for share in row[3:])) for row in table.rows()]
    show_table("consistent frames, %", HEADS, rows)


if __name__ == "__main__":
    run_command(app)
