"""The command `learn`: pushes of one beam in, its rig.json out."""

import math
from pathlib import Path
from typing import Annotated, NamedTuple

import typer
from rich.progress import track
from scipy.constants import g

from solver.centreline.extractors import find_extractor
from solver.instrument.errors import InputError, quoted
from solver.instrument.image_frame import ImageFrame
from solver.instrument.rig_json import rig_to_json
from solver.instrument.units import GRAM, MILLIMETRE
from solver.lab.console import console, setting_up, show_findings
from solver.lab.controls import NO_CONTROLS
from solver.lab.options import (
    CentrelineOption,
    ChannelOption,
    OtherRigOption,
    PageOption,
    ReadingsOption,
    open_inputs,
)
from solver.lab.writing import prepare_output_and_page, write
from solver.learning.clamp_offset import ObjectRadius
from solver.learning.frames import frames_to_learn, learn_from_frames, measurement_of
from solver.learning.known_force import rig_with_force
from solver.learning.page import page, summary
from solver.methods import Method
from solver.methods.exact_fit import exact_fit
from solver.methods.hung_weight import hung_weight as hung_load
from solver.set_up import set_up


def learn(
    sources: Annotated[
        list[str],
        typer.Argument(
            help="pushes at several places of the beam: observations folder; or images, with --rig"
        ),
    ],
    out: Annotated[Path, typer.Option(help="rig.json to write, with the learned beam")],
    rig: OtherRigOption = None,
    readings: ReadingsOption = None,
    channel: ChannelOption = None,
    centreline: CentrelineOption = "profile_fit",
    known_force: Annotated[
        tuple[str, float, float] | None,
        typer.Option(
            help="frame, its contact's force and sigma in N, as of a balance: gives EI",
            metavar="FRAME_ID NEWTON SIGMA",
        ),
    ] = None,
    hung_weight: Annotated[
        tuple[str, float, float] | None,
        typer.Option(
            help="frame with a hung weight, its mass and sigma in gram, thread included: gives EI; "
            "rig.json states the direction of gravity",
            metavar="FRAME_ID GRAM SIGMA",
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
    web_page: PageOption = None,
) -> None:
    """Learn the beam and its clamp from pushes against unknown objects, by images alone.

    Frames of a push share push_id in the table of readings; with a column split, those marked
    "learn" are used. The rig's EI at the clamp stays unless one force is known, of a contact or of
    a hung weight: images show only how EI changes along the beam. Objects must be at rest, each
    push against one, for the clamp's offset from the motor's axis to be learned too.
    """
    known = _known_force(known_force, hung_weight)
    learn_extractor = find_extractor(centreline)
    inputs = open_inputs(sources, rig, readings, channel, NO_CONTROLS)
    files = inputs.observations
    if not files.frames:
        raise InputError("learn needs images of pushes: save some with the command snap")
    radius = None if object_radius is None else _radius(*object_radius)
    prepare_output_and_page(out, web_page, inputs.files)
    with setting_up(quiet=False):
        antenna = set_up(files, learn_extractor)
    show_findings(inputs.findings(antenna), inputs.rig)
    # A weight does not push against the beam's normal.
    hung = {hung_weight[0]} if hung_weight else set()
    images = frames_to_learn([frame for frame in files if frame.frame_id not in hung])
    measured = track(images, "measuring", console=console, transient=True)
    beam = learn_from_frames(antenna, measured, radius, _say_left_out)
    learned = beam.rig(files.rig)
    if known is not None:
        frame = next((frame for frame in files if frame.frame_id == known.frame_id), None)
        measurement = None if frame is None else measurement_of(antenna, frame)
        if measurement is None:
            raise InputError(
                f"{known.option}: {quoted(known.frame_id)} is no frame that shows the beam"
            )
        learned = rig_with_force(learned, measurement, known.force, known.sigma, known.method)
    write(out, rig_to_json(learned).encode())
    if web_page:
        write(web_page, page(beam, learned, files.rig).encode())
    written = f"{out} and {web_page}" if web_page else f"{out}"
    print(f"{summary(beam, learned, files.rig)}\nwritten to {written}")


def _say_left_out(frame: ImageFrame, reason: str) -> None:
    console.print(f"left out: {frame.frame_id}: {reason}", markup=False, soft_wrap=True)


class _KnownForce(NamedTuple):
    """A force [N] and its sigma in one frame, the option that states it, and its method."""

    option: str
    frame_id: str
    force: float
    sigma: float
    method: Method


def _known_force(
    contact: tuple[str, float, float] | None, weight: tuple[str, float, float] | None
) -> _KnownForce | None:
    if contact and weight:
        raise InputError("--known-force and --hung-weight are given, allowed is one of them")
    if contact:
        return _KnownForce("--known-force", *contact, exact_fit)
    if weight:
        frame_id, mass, sigma = weight
        return _KnownForce("--hung-weight", frame_id, mass * GRAM * g, sigma * GRAM * g, hung_load)
    return None


def _radius(radius_mm: float, sigma_mm: float) -> ObjectRadius:
    if not (0 <= radius_mm < math.inf and 0 <= sigma_mm < math.inf):
        raise InputError(
            f"--object-radius is {radius_mm:g} +- {sigma_mm:g} mm, allowed are numbers from 0"
        )
    return ObjectRadius(radius_mm * MILLIMETRE, sigma_mm * MILLIMETRE)
