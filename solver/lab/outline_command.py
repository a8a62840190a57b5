"""The command `outline`: estimates from many poses in, the outline of the object out."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from solver.instrument.metadata import read_frames
from solver.instrument.observation import open_observations, rig_file
from solver.instrument.rig_json import read_rig
from solver.lab.outline import csv_text, read_estimates, summary
from solver.lab.writing import prepare_output_path, write
from solver.outline.contacts import contacts_of
from solver.outline.fit import fit_outline


def outline(
    estimates: Annotated[Path, typer.Argument(help="CSV of estimates, written by solve")],
    rig: Annotated[Path, typer.Option(help="rig.json, or the observations folder it is in")],
    readings: Annotated[
        Path | None,
        typer.Option(
            help="table like metadata.csv with the poses of the carriage, beside the images",
            show_default="those of the observations folder",
        ),
    ] = None,
    out: Annotated[Path, typer.Option(help="CSV to write")] = Path("outline.csv"),
) -> None:
    """Estimate the outline of an object that was touched from many poses of the antenna."""
    if readings is None:
        observations = open_observations(rig)
        frames, nominal = observations.frames, observations.rig
    else:
        frames, nominal = tuple(read_frames(readings)), read_rig(rig_file(rig))
    prepare_output_path(out, (estimates, rig_file(rig), *((readings,) if readings else ())))
    result = fit_outline(contacts_of(read_estimates(estimates), frames, nominal))
    write(out, csv_text(result).encode())
    Console(highlight=False, soft_wrap=True).print(summary(result), markup=False)
