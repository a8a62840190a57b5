"""The command `speed`: times of methods beside their errors."""

from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console

from vbaa_bench.cli.interrupt import importing
from vbaa_bench.cli.options import AsJson, Repeats, Variant
from vbaa_bench.report.console import console, print_result, show_table

QUICKSTART = "quickstart"


def speed(
    dataset: Annotated[
        Path | None,
        typer.Argument(help="dataset folder", show_default=f"rendered from {QUICKSTART}"),
    ] = None,
    method: Annotated[
        list[str] | None,
        typer.Option(help="method of the solver; repeatable", show_default="all"),
    ] = None,
    frames: Annotated[
        int, typer.Option(min=1, help="maximum number of frames; pushes are not split")
    ] = 120,
    repeats: Repeats = 3,
    first_ever: Annotated[
        bool, typer.Option(help="also measure a first start, which compiles for over a minute")
    ] = True,
    variant: Variant = None,
    as_json: AsJson = False,
) -> None:
    """Measure the time of each method, from an image in memory and from points, and its error."""
    with importing():
        from vbaa_bench.benchmarks.speed import measure_apart, with_errors
        from vbaa_bench.dataset.layout import Layout
        from vbaa_bench.dataset.readers import open_truth

    layout = Layout(dataset or _quickstart(variant))
    truth = open_truth(layout.truth)
    with console.status("measuring on one core"):
        measured = measure_apart(
            layout.observations, method, frames, repeats, first_ever=first_ever
        )
    record = {"dataset": str(layout.root), **with_errors(truth, measured)}
    if as_json:
        print_result(record, "", True)
    else:
        show_speeds(record)


def show_speeds(record: dict[str, Any]) -> None:
    """Print the table of `vbaa-bench speed`."""
    width, height = record["image_px"]
    title = (
        f"{record['frames']} frames of {width} x {height} px, one core; not included: "
        f"decoding {record['decode_ms_per_frame']:.2g} ms per frame, "
        f"calibration {record['set_up_s']:.2g} s"
    )
    heads = ("method", "ms/image", "us/points", "x_c, % of L", "force, %", "start, s")
    rows = []
    for name, values in record["methods"].items():
        numbers = (
            values["image_ms_per_frame"],
            values["points_us_per_frame"],
            values["x_c_rmse_pct_L"],
            values["force_rmse_pct"],
            values["cold_start"]["total_s"],
            (values["first_start"] or {}).get("total_s"),
        )
        cells = ("–" if number is None else f"{float(f'{number:.3g}'):,g}" for number in numbers)
        rows.append((name, *cells))
    show_table(title, (*heads, "first ever, s"), rows)
    Console().print(
        "Errors are RMSEs over frames with an estimate. A start lasts from the command to the "
        "first estimate; the first start ever includes compilation, whose result is cached."
    )
    for name, values in record["methods"].items():
        if set(values["outcomes"]) != {"contact"}:
            counts = ", ".join(
                f"{count} {outcome}" for outcome, count in values["outcomes"].items()
            )
            Console(soft_wrap=True).print(f"{name}: {counts}", highlight=False, markup=False)


def _quickstart(variant: str | None) -> Path:
    with importing():
        from vbaa_bench.api.data import generate

    root = Path("runs") / QUICKSTART
    with console.status(f"rendering {QUICKSTART}"):
        generate(QUICKSTART, root, variant=variant)
    return root
