"""The commands of `python -m solver`, and their errors."""

import difflib
import os
import string
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, closing
from pathlib import Path
from typing import Annotated, NamedTuple

import cv2
import typer
from rich.console import Console

from solver.antenna import Antenna
from solver.centreline.extractors import find_extractor
from solver.instrument.errors import InputError
from solver.instrument.image_frame import ImageFrame
from solver.instrument.images import png_bytes
from solver.instrument.observation import frames_beside, open_rig_files, rig_file, tables_beside
from solver.instrument.rig_json import read_rig
from solver.lab.check import calibration_report
from solver.lab.command_end import run_command
from solver.lab.console import (
    console,
    expected_accuracy,
    reasons,
    setting_up,
    show_findings,
    table,
    with_progress,
)
from solver.lab.controls import controls_of
from solver.lab.example import example_rig, next_steps
from solver.lab.file_findings import file_findings
from solver.lab.help import Command, Group
from solver.lab.learn_command import learn
from solver.lab.live import json_line, solve_shots, warm_up
from solver.lab.options import (
    BeamOption,
    CentrelineOption,
    ChannelOption,
    ControlOption,
    ExposureOption,
    JsonOption,
    MethodOption,
    OtherRigOption,
    ReadingsOption,
    RigOption,
    SizeOption,
    checked_channel,
    open_inputs,
)
from solver.lab.outline_command import outline
from solver.lab.overlay import OverlayWriter, check_overlay, draw
from solver.lab.photos_command import photos
from solver.lab.protocol_report import protocol_report
from solver.lab.rigidity_command import rigidity
from solver.lab.sources import open_source
from solver.lab.table import Row, csv_text
from solver.lab.target import svg
from solver.lab.trace_command import trace
from solver.lab.writing import prepare_output_path, write
from solver.learning.frames import frames_to_learn, learn_from_frames, with_learned
from solver.methods import LEARNING, Method
from solver.methods.by_name import find_method, with_beam
from solver.methods.exact_fit_learned import exact_fit_stated
from solver.set_up import set_up

app = typer.Typer(
    cls=Group,
    help="Estimate contact and force from images of a beam. The word solve may be left out: "
    "python -m solver images/*.png --rig rig",
    add_completion=False,
    pretty_exceptions_enable=False,
    no_args_is_help=True,
)


@app.command()
def solve(
    sources: Annotated[
        list[str],
        typer.Argument(help="observations folder; or images, a video, a camera, with --rig"),
    ],
    rig: OtherRigOption = None,
    method: MethodOption = "exact_fit",
    centreline: CentrelineOption = "profile_fit",
    beam: BeamOption = None,
    readings: ReadingsOption = None,
    out: Annotated[
        Path | None,
        typer.Option(help="CSV to write", show_default="estimates_<method>.csv, none for a camera"),
    ] = None,
    stream: Annotated[
        bool, typer.Option("--stream", help="print one line of JSON per frame to stdout")
    ] = False,
    overlay: Annotated[
        Path | None,
        typer.Option(help="folder, .mp4 or .avi for the overlays, .png for a single one"),
    ] = None,
    channel: ChannelOption = None,
    size: SizeOption = None,
    exposure: ExposureOption = None,
    control: ControlOption = None,
    repeats: Annotated[
        int, typer.Option(min=1, help="runs per frame; the median time is reported")
    ] = 1,
    quiet: Annotated[bool, typer.Option(help="no table, no progress, no warnings")] = False,
) -> None:
    """Estimate contact and force in every frame: a table and a CSV, or a stream of JSON."""
    _check_command(sources[0])
    function, learn_extractor = with_beam(find_method(method), beam), find_extractor(centreline)
    controls = controls_of(size, exposure, control or ())
    inputs = open_inputs(sources, rig, readings, channel, controls)
    observations, source = inputs.observations, inputs.source
    if method in LEARNING and not observations.frames:
        raise InputError(
            f"method '{method}' learns the beam from images, and a camera or video has none: use "
            "the command learn, and then exact_fit with the rig that it has written"
        )
    target = out or (
        None if source.live or stream else Path(f"estimates_{method.replace(':', '.')}.csv")
    )
    if target:
        prepare_output_path(target, inputs.files)
    replaces = target is not None and target.exists()
    check_overlay(overlay, source, inputs.files, target)
    with setting_up(quiet):
        antenna = set_up(observations, learn_extractor)
        if method in LEARNING:
            antenna, function = _learned(antenna, function, observations.frames)
        warm_up(antenna, function, next(observations.read_rest_images()))
    contradictions = () if quiet else inputs.findings(antenna)
    show_findings(contradictions, inputs.rig)
    rows: dict[int, Row] = {}
    interrupted = False
    try:
        with ExitStack() as stack:
            writer = stack.enter_context(OverlayWriter(overlay, source.rate)) if overlay else None
            results = stack.enter_context(closing(solve_shots(source, antenna, function, repeats)))
            for answer in stack.enter_context(with_progress(results, source, quiet or stream)):
                if target:
                    rows[answer.shot.number] = answer.row
                if stream:
                    print(json_line(answer), flush=True)
                if writer and answer.solved.line is not None:
                    writer.write(draw(antenna, answer), answer.shot.number, answer.shot.name)
    except KeyboardInterrupt:
        interrupted = True
    finally:
        # In the order of the frames, not in that of the estimates.
        ordered_rows = [rows[number] for number in sorted(rows)]
        if target and ordered_rows:
            write(target, csv_text(ordered_rows).encode())
    if target and not (quiet or stream):
        # EI is not what limits the forces of a rig that contradicts its images.
        accuracy = () if contradictions else expected_accuracy(ordered_rows, antenna.rig)
        where = f"{target}, replacing the one before" if replaces else str(target)
        _show(ordered_rows, method, where, accuracy)
    if interrupted and not source.live:  # Ctrl-C is how a camera is switched off
        console.print("interrupted: the estimates so far are kept")
        raise typer.Exit(130)


def _show(rows: list[Row], method: str, where: str, accuracy: Sequence[str]) -> None:
    Console().print(table(rows, method))
    count = f"{len(rows)} estimate{'' if len(rows) == 1 else 's'}"
    for line in (*reasons(rows), *accuracy, f"{count} in {where}"):
        print(line)


def _check_command(word: str) -> None:
    """Raise InputError for a mistyped command, which is taken for an image."""
    names = [one.callback.__name__ for one in app.registered_commands if one.callback]
    close = difflib.get_close_matches(word, names, 1)
    if close and not Path(word).exists():
        raise InputError(f"'{word}' is neither a command nor a file; did you mean '{close[0]}'?")


class _Learned(NamedTuple):
    """An antenna with its beam, and the method that estimates with it."""

    antenna: Antenna
    method: Method


def _learned(antenna: Antenna, method: Method, frames: Sequence[ImageFrame]) -> _Learned:
    """Learn the beam from frames; the method says so where they show none."""
    try:
        beam = learn_from_frames(antenna, frames_to_learn(frames))
    except InputError as error:
        return _Learned(antenna, exact_fit_stated(str(error)))
    return _Learned(with_learned(antenna, beam), method)


@app.command()
def demo(
    out: Annotated[Path, typer.Option(help="folder for the table and the overlays")] = Path("demo"),
) -> None:
    """Estimate the forces in six images of the example rig; say how to go on with a camera."""
    example = example_rig()
    solve([str(example)], out=out / "estimates.csv", overlay=out)
    print(f"overlays in {out}{os.sep}*.png: all dots must be on the beam\n{next_steps(example)}")


@app.command()
def warm(
    rig: RigOption,
    method: MethodOption = "exact_fit",
) -> None:
    """Compile all code that a frame needs, so that the next start takes seconds."""
    function, observations = find_method(method), open_rig_files(rig)
    start = time.perf_counter()
    with setting_up(quiet=False):
        warm_up(set_up(observations), function, next(observations.read_rest_images()))
    console.print(f"ready after {time.perf_counter() - start:.1f} s")


@app.command()
def board(
    out: Annotated[Path, typer.Argument(help="SVG to write")],
    rig: Annotated[Path, typer.Option(help="rig.json that describes the board")],
) -> None:
    """Draw the rig's calibration board in its true size, for printing at 100 %."""
    prepare_output_path(out, (rig_file(rig),))
    write(out, svg(read_rig(rig_file(rig)).board).encode())
    console.print(f"written to {out}", markup=False)


@app.command()
def snap(
    sources: Annotated[
        list[str], typer.Argument(help="a camera, or images to convert to gray, one PNG each")
    ],
    out: Annotated[
        Path, typer.Argument(help="PNG to write, such as rest/rest_00.png; others are numbered on")
    ],
    rig: Annotated[Path | None, typer.Option(help="rig.json whose camera.channel is used")] = None,
    channel: ChannelOption = None,
    size: SizeOption = None,
    exposure: ExposureOption = None,
    control: ControlOption = None,
    drop: Annotated[
        int,
        typer.Option(min=0, help="number of first frames dropped while the exposure settles"),
    ] = 30,
) -> None:
    """Save a camera's image as a gray PNG, of board or beam at rest; or convert images."""
    used_channel = checked_channel(channel) or (read_rig(rig_file(rig)).channel if rig else "gray")
    controls = controls_of(size, exposure, control or ())
    frames = open_source(sources, channel=used_channel, controls=controls)
    settled = (shot for shot in frames if not frames.live or shot.number >= drop)
    # Of a camera, as of a video, one image.
    for path, shot in zip(_numbered(out, len(sources)), settled, strict=False):
        prepare_output_path(path, map(Path, sources))
        replaces = path.exists()
        write(path, png_bytes(shot.pixels()))
        console.print(f"{path} {'replaced' if replaces else 'written'}", markup=False)


def _numbered(path: Path, count: int) -> Iterator[Path]:
    """Continue the number at the end of a name: rest_00.png, rest_01.png, ..."""
    stem = path.stem.rstrip(string.digits)
    digits = path.stem[len(stem) :] or "00"
    yield path
    for number in range(int(digits) + 1, int(digits) + count):
        yield path.with_stem(f"{stem}{number:0{len(digits)}d}")


@app.command()
def check(
    rig: OtherRigOption = None,
    protocol: Annotated[
        Path | None,
        typer.Option(
            help="folder of a set with known loads, in place of --rig: says all that is missing or "
            "wrong, and compares the estimates with balance and ruler"
        ),
    ] = None,
    json: JsonOption = False,
) -> None:
    """Report the quality of the calibration and of the rest images; exit with 1 after a warning.

    Images of pushes in the folder images/ beside the rig are compared with it, too.
    """
    if rig is None and protocol is not None:
        _check_protocol(protocol, json)
        return
    if rig is None or protocol is not None:
        raise InputError("check needs either --rig or --protocol")
    opened = open_rig_files(rig)
    frames = frames_beside(opened.root, opened.rig.channel)
    of_files = file_findings(opened, tables_beside(opened.root))
    report = calibration_report(set_up(opened), frames, len(opened.ground_images), of_files)
    print(report.json() if json else report.text())
    if report.warnings:
        raise typer.Exit(1)


def _check_protocol(folder: Path, as_json: bool) -> None:
    """Print what is missing or wrong in a set, and its scores; exit with 1 if anything is."""
    if not folder.is_dir():
        raise InputError(f"{folder}: is not a folder")
    with setting_up(quiet=as_json):
        report = protocol_report(folder)
    if as_json:
        print(report.json())
    else:
        if report.comparisons:
            Console().print(*report.tables())
        print(report.text())
    if report.findings:
        raise typer.Exit(1)


for command in (rigidity, learn, outline, photos, trace):
    app.command()(command)
for registered in app.registered_commands:
    registered.cls = Command


def main() -> None:
    """Run `solve`, unless the first word names another command.

    The process exits as `run_command` does.
    """
    # Errors of images are reported by InputError, not by OpenCV's log.
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
    arguments = sys.argv[1:]
    commands = [
        command.callback.__name__ for command in app.registered_commands if command.callback
    ]
    if arguments and arguments[0] not in (*commands, "--help"):
        arguments = ["solve", *arguments]
    run_command(lambda: app(arguments))
