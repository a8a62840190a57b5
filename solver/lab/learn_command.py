"""The command `learn`: pushes of one beam in, its rig.json out."""

import math
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import track

from solver.centreline.extractors import EXTRACTORS, find_extractor
from solver.instrument.errors import InputError, quoted
from solver.instrument.observation import open_observations
from solver.instrument.rig import rig_to_json
from solver.instrument.units import MILLIMETRE
from solver.lab.console import console, setting_up
from solver.lab.writing import prepare_output_path, write
from solver.learning.clamp_offset import ObjectRadius
from solver.learning.frames import frames_to_learn, learn_from_frames, measurement_of
from solver.learning.known_force import rig_with_force
from solver.learning.page import page, summary
from solver.set_up import set_up


def learn(
    observations: Annotated[
        Path, typer.Argument(help="folder of observations: pushes at several places of the beam")
    ],
    out: Annotated[Path, typer.Option(help="rig.json to write, with the learned beam")],
    centreline: Annotated[
        str, typer.Option(help=f"centreline extractor: {', '.join(EXTRACTORS)}")
    ] = "profile_fit",
    known_force: Annotated[
        tuple[str, float, float] | None,
        typer.Option(
            help="frame, its contact's force and sigma in N, as of a balance: gives EI",
            metavar="FRAME_ID NEWTON SIGMA",
        ),
    ] = None,
    object_radius: Annotated[
        tuple[float, float] | None,
        typer.Option(
            help="radius of all touched objects and its sigma in mm, 0 for an edge: gives the "
            "clamp's offset from the motor's axis in both directions",
            metavar="MM SIGMA",
        ),
    ] = None,
    web_page: Annotated[
        Path | None, typer.Option("--page", help="HTML page with pictures to write")
    ] = None,
) -> None:
    """Learn the beam and its clamp from pushes against unknown objects, by images alone.

    Frames of a push share push_id in metadata.csv; with a column split, those marked "learn" are
    used. The rig's EI at the clamp stays unless one force is known: images show only how EI
    changes along the beam. Objects must be at rest, each push against one, for the clamp's offset
    from the motor's axis to be learned too.
    """
    files, learn_extractor = open_observations(observations), find_extractor(centreline)
    radius = None if object_radius is None else _radius(*object_radius)
    for path in filter(None, (out, web_page)):
        prepare_output_path(path)
    with setting_up(quiet=False):
        antenna = set_up(files, learn_extractor)
    images = frames_to_learn(files.frames)
    measured = track(images, "measuring", console=console, transient=True)
    beam = learn_from_frames(antenna, measured, radius)
    rig = beam.rig(files.rig)
    if known_force:
        frame_id, force, sigma = known_force
        frame = next((frame for frame in files if frame.frame_id == frame_id), None)
        measurement = None if frame is None else measurement_of(antenna, frame)
        if measurement is None:
            raise InputError(f"--known-force: {quoted(frame_id)} is no frame that shows the beam")
        rig = rig_with_force(rig, measurement, force, sigma)
    write(out, rig_to_json(rig).encode())
    if web_page:
        write(web_page, page(beam, rig).encode())
    Console(highlight=False, soft_wrap=True).print(
        f"{summary(beam, rig)}\nwritten to {out}", markup=False
    )


def _radius(radius_mm: float, sigma_mm: float) -> ObjectRadius:
    if not (0 <= radius_mm < math.inf and 0 <= sigma_mm < math.inf):
        raise InputError(
            f"--object-radius is {radius_mm:g} +- {sigma_mm:g} mm, allowed are numbers from 0"
        )
    return ObjectRadius(radius_mm * MILLIMETRE, sigma_mm * MILLIMETRE)
