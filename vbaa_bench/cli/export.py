"""The command that exports a dataset to the formats of other tools."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from vbaa_bench.cli.interrupt import importing
from vbaa_bench.cli.options import AsJson, DatasetPath
from vbaa_bench.report.console import console, print_result, progress_bars


class FormatName(StrEnum):
    """Names of the formats, in the order of the help."""

    HF = "hf"
    WEBDATASET = "webdataset"
    LEROBOT = "lerobot"
    BOP = "bop"
    CSV = "csv"


def export(
    dataset: DatasetPath,
    to: Annotated[FormatName, typer.Option("--to", help="format to write")],
    out: Annotated[Path, typer.Option(help="new folder to write")],
    centrelines: Annotated[
        bool, typer.Option("--centrelines", help="export the centrelines too, 15 kB per frame")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Export a dataset or a collection for other tools, and check it by reading it back.

    Run the command again to continue an interrupted export.
    """
    with importing():
        from vbaa_bench.exports.export import export as export_dataset

    try:
        with progress_bars() as bars:
            tasks = {step: bars.add_task(step, total=None) for step in ("writing", "checking")}
            result = export_dataset(
                dataset,
                to,
                out,
                lambda step, done, total: bars.update(tasks[step], completed=done, total=total),
                centrelines=centrelines,
            )
    except KeyboardInterrupt:
        console.print("interrupted; run the same command again to continue")
        raise
    record = {"export": str(out), "frames": result.frames, "splits": result.splits}
    print_result(record, f"{result.frames} frames in {out}, read back and equal", as_json)
