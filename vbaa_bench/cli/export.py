"""The command that exports a dataset to the formats of other tools."""

import sys
from contextlib import ExitStack
from pathlib import Path
from typing import Annotated, Final

import typer

from vbaa_bench.cli.interrupt import importing
from vbaa_bench.cli.options import AsJson, DatasetPath, checked_path
from vbaa_bench.exports.format import FORMATS
from vbaa_bench.report.console import console, late_bars, print_result

# Metadata that are added to the dataset, and no format of frames.
_CROISSANT: Final = "croissant"


def _format_names(incomplete: str) -> list[str]:
    """Complete the name of a format."""
    return [name for name in (*FORMATS, _CROISSANT) if name.startswith(incomplete)]


def export(
    dataset: DatasetPath,
    to: Annotated[
        str,
        typer.Option(
            autocompletion=_format_names,
            help=f"{', '.join(FORMATS)}, {_CROISSANT}, or package.module:Class, see "
            "docs/export_formats.md",
        ),
    ],
    out: Annotated[
        Path | None,
        typer.Option(
            callback=checked_path,
            help="new folder to write",
            show_default="for croissant: into the dataset",
        ),
    ] = None,
    centrelines: Annotated[
        bool, typer.Option("--centrelines", help="export the centrelines too, 15 kB per frame")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Export a dataset or a collection for other tools, and check it by reading it back.

    Run the command again to continue an interrupted export. croissant adds metadata to the dataset.
    """
    with importing():
        from solver.instrument.errors import InputError
        from vbaa_bench.api.export import export as export_dataset
        from vbaa_bench.api.export import write_croissant

    if (to == _CROISSANT) != (out is None):
        raise InputError(
            f"--to is {to} and --out is {out}, allowed is a new folder, or no --out with --to "
            "croissant, which writes into the dataset"
        )
    if out is None:
        with console.status("reading the dataset"):
            path = write_croissant(dataset)
        print_result({"croissant": str(path)}, str(path), as_json)
        return
    if ":" in to:  # a format of the user's own may be in the current folder
        sys.path.append(str(Path.cwd()))
    try:
        with ExitStack() as shown:
            result = export_dataset(
                dataset,
                to,
                out,
                centrelines=centrelines,
                progress=late_bars(shown, ("reading", "writing", "checking")),
            )
    except KeyboardInterrupt:
        console.print("interrupted; run the same command again to continue")
        raise
    record = {"export": str(out), "frames": result.frames, "splits": result.splits}
    print_result(record, f"{result.frames} frames in {out}, read back and equal", as_json)
