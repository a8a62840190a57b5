"""Command line of the solver: `python -m solver OBSERVATIONS --method exact_fit`."""

import sys
import time
from contextlib import ExitStack, closing
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import cv2
import typer
from rich.console import Console

from solver.calibrate.rigidity import HungWeight, flexural_rigidity
from solver.centreline.extractors import EXTRACTORS, find_extractor
from solver.instrument.arrays import Grey
from solver.instrument.errors import InputError
from solver.instrument.images import CHANNELS, png_bytes
from solver.instrument.measurement import Measurement
from solver.instrument.observation import Observations, open_observations, open_rig, rig_file
from solver.instrument.rig import read_rig
from solver.instrument.units import DEGREE, MILLIMETRE, NEWTON_SQUARE_MILLIMETRE
from solver.lab.check import calibration_report
from solver.lab.console import console, setting_up, table, with_progress
from solver.lab.controls import NO_CONTROLS, Controls, controls_of
from solver.lab.learn_command import learn
from solver.lab.live import json_line, solve_shots, warm_up
from solver.lab.outline_command import outline
from solver.lab.overlay import OverlayWriter, draw
from solver.lab.photos_command import photos
from solver.lab.shots import Files, Source
from solver.lab.sources import open_source
from solver.lab.table import Row, csv_text
from solver.lab.target import svg
from solver.lab.writing import prepare_output_path, write
from solver.learning.frames import frames_to_learn, learn_from_frames, with_learned
from solver.methods import LEARNING, METHODS
from solver.methods.by_name import find_method
from solver.set_up import set_up
from solver.to_measurement import to_measurement
from solver.tracker import extract_centreline

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False, no_args_is_help=True)

RigOption = Annotated[
    Path, typer.Option(help="rig.json, with calibration/ and rest/ images beside it")
]
ChannelOption = Annotated[
    str | None,
    typer.Option(
        help=f"channel read from colour images: {', '.join(CHANNELS)}",
        show_default="camera.channel of rig.json, or gray",
    ),
]
SizeOption = Annotated[str | None, typer.Option(help="image size of a camera: WIDTHxHEIGHT")]
ExposureOption = Annotated[
    float | None, typer.Option(help="manual exposure, in the camera's unit", show_default="auto")
]
ControlOption = Annotated[
    list[str] | None,
    typer.Option(help="OpenCV camera property: gain=4, fourcc=Y16; may be repeated"),
]


@app.command()
def solve(
    sources: Annotated[
        list[str],
        typer.Argument(help="observations folder; or images, a video, a camera, with --rig"),
    ],
    rig: Annotated[
        Path | None, typer.Option(help="rig.json, with calibration/ and rest/ images beside it")
    ] = None,
    method: Annotated[
        str, typer.Option(help=f"{', '.join(METHODS)}, or package.module:function")
    ] = "exact_fit",
    centreline: Annotated[
        str, typer.Option(help=f"centreline extractor: {', '.join(EXTRACTORS)}")
    ] = "profile_fit",
    readings: Annotated[
        Path | None, typer.Option(help="table like metadata.csv, in the folder of the images")
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(help="CSV to write", show_default="estimates_<method>.csv, none for a camera"),
    ] = None,
    stream: Annotated[
        bool, typer.Option("--stream", help="print one line of JSON per frame to stdout")
    ] = False,
    overlay: Annotated[
        Path | None, typer.Option(help="folder, .mp4 or .avi for images with the overlay")
    ] = None,
    channel: ChannelOption = None,
    size: SizeOption = None,
    exposure: ExposureOption = None,
    control: ControlOption = None,
    repeats: Annotated[
        int, typer.Option(min=1, help="runs per frame; the median time is reported")
    ] = 1,
    quiet: Annotated[bool, typer.Option(help="no table, no progress")] = False,
) -> None:
    """Estimate contact and force in every frame: a table and a CSV, or a stream of JSON."""
    function, learn_extractor = find_method(method), find_extractor(centreline)
    controls = controls_of(size, exposure, control or ())
    observations, source = _open(sources, rig, readings, channel, controls)
    target = out or (
        None if source.live or stream else Path(f"estimates_{method.replace(':', '.')}.csv")
    )
    if target:
        prepare_output_path(target)
    with setting_up(quiet):
        antenna = set_up(observations, learn_extractor)
        if method in LEARNING:
            beam = learn_from_frames(antenna, frames_to_learn(observations.frames))
            antenna = with_learned(antenna, beam)
        warm_up(antenna, function, next(observations.read_rest_images()))
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
        Console().print(table(ordered_rows, method))
        Console(soft_wrap=True).print(f"{len(ordered_rows)} estimates in {target}", markup=False)
    if interrupted and not source.live:  # Ctrl-C is how a camera is switched off
        console.print("interrupted: the estimates so far are kept")
        raise typer.Exit(130)


@app.command()
def warm(
    rig: RigOption,
    method: Annotated[
        str, typer.Option(help=f"{', '.join(METHODS)}, or package.module:function")
    ] = "exact_fit",
) -> None:
    """Compile all code that a frame needs, so that the next start takes seconds."""
    function, observations = find_method(method), open_rig(rig)
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
    write(out, svg(read_rig(rig_file(rig)).board).encode())


@app.command()
def snap(
    source: Annotated[str, typer.Argument(help="a camera, or an image to convert to gray")],
    out: Annotated[Path, typer.Argument(help="PNG to write, such as rest/rest_00.png")],
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
    """Save one camera image as a gray PNG: of the board, or of the beam at rest."""
    used_channel = _channel(channel) or (read_rig(rig_file(rig)).channel if rig else "gray")
    controls = controls_of(size, exposure, control or ())
    frames = open_source([source], channel=used_channel, controls=controls)
    prepare_output_path(out)
    shot = next(shot for shot in frames if not frames.live or shot.number >= drop)
    write(out, png_bytes(shot.grey()))


@app.command()
def check(
    rig: RigOption,
    json: Annotated[bool, typer.Option("--json", help="print one line of JSON")] = False,
) -> None:
    """Report the quality of the calibration and of the rest images."""
    report = calibration_report(set_up(open_rig(rig)))
    print(report.json() if json else report.text())


@app.command()
def rigidity(
    images: Annotated[list[str], typer.Argument(help="images of the beam under the weight")],
    rig: RigOption,
    weight_g: Annotated[float, typer.Option(min=0, help="mass, thread included")],
    at_mm: Annotated[float, typer.Option(min=0, help="its distance from the clamp")],
    weight_sigma_g: Annotated[float, typer.Option(min=0)] = 0.01,
    at_sigma_mm: Annotated[float, typer.Option(min=0)] = 0.5,
    level_sigma_deg: Annotated[
        float, typer.Option(min=0, help="one-sigma tilt of the clamp")
    ] = 0.5,
    gravity_m_s2: Annotated[float, typer.Option(min=0, help="local gravity")] = 9.807,
) -> None:
    """Estimate EI from a weight that hangs on the beam, in the calibration board's plane."""
    if weight_g == 0 or gravity_m_s2 == 0:
        raise InputError("--weight-g and --gravity-m-s2 must be above 0")
    observations, source = _open(images, rig, None, None, NO_CONTROLS)
    if source.live:
        raise InputError("rigidity needs images: save some with the command snap")
    antenna = set_up(observations)
    # The sag at rest is a load to be fitted, not a bow to be subtracted.
    at_rest = antenna.at_rest
    antenna = replace(antenna, at_rest=replace(at_rest, rest=at_rest.rest.without_bow()))

    def measurement_of(image: Grey) -> Measurement:
        return to_measurement(antenna, extract_centreline(antenna, image))

    newton = gravity_m_s2 / 1e3
    result = flexural_rigidity(
        [measurement_of(image) for image in observations.read_rest_images()],
        [measurement_of(shot.grey()) for shot in source],
        HungWeight(
            force=weight_g * newton,
            force_sigma=weight_sigma_g * newton,
            at=at_mm * MILLIMETRE,
            at_sigma=at_sigma_mm * MILLIMETRE,
            level_sigma=level_sigma_deg * DEGREE,
        ),
    )
    value, sigma = result.value / NEWTON_SQUARE_MILLIMETRE, result.sigma / NEWTON_SQUARE_MILLIMETRE
    nominal = observations.rig.beam.flexural_rigidity / NEWTON_SQUARE_MILLIMETRE
    output = Console(highlight=False, soft_wrap=True)
    output.print(
        f"EI = {value:.5g} +- {sigma:.2g} N mm^2 ({100 * sigma / value:.2g} %), "
        f"{100 * (value / nominal - 1):+.2f} % from the rig's {nominal:.5g}.\n"
        f"Fitted place of the weight: {result.at / MILLIMETRE:.2f} "
        f"+- {result.at_sigma / MILLIMETRE:.2f} mm; tip sag by own weight: "
        f"{abs(result.sag) / MILLIMETRE:.2f} mm; residual scatter: {result.misfit:.2g} sigma.\n"
        f"In {rig_file(rig)}, under beam, write\n"
        f'    "flexural_rigidity_n_mm2": {value:.6g},\n'
        f'    "flexural_rigidity_sigma_n_mm2": {sigma:.3g},\n'
        "and under beam_shape, as EI is now that of the plane in which the beam bends, write\n"
        '    "rigidity_sigma": 0,',
        markup=False,
    )


for command in (learn, outline, photos):
    app.command()(command)


def _open(
    sources: list[str],
    rig: Path | None,
    readings: Path | None,
    channel: str | None,
    controls: Controls,
) -> tuple[Observations, Source]:
    """Open the rig with its calibration and rest images, and the source of frames.

    `channel` replaces the rig's, for images at rest and for frames.
    """
    if rig is not None:
        observations = open_rig(rig)
        used_channel = _channel(channel) or observations.rig.channel
        observations = replace(observations, rig=replace(observations.rig, channel=used_channel))
        return observations, open_source(sources, readings, used_channel, controls)
    root = Path(sources[0])
    if len(sources) > 1 or not root.is_dir():
        raise InputError(
            f"{sources[0]}: is not a folder of observations, "
            "and images, a video or a camera need --rig rig.json"
        )
    if readings is not None or channel is not None or controls != NO_CONTROLS:
        raise InputError(
            "--readings, --channel, --size, --exposure and --control are for images, videos and "
            "cameras; a folder of observations has its own"
        )
    observations = open_observations(root)
    return observations, Files(observations.frames)


def _channel(name: str | None) -> str | None:
    """Check the option --channel. Raises InputError."""
    if name is not None and name not in CHANNELS:
        raise InputError(f"--channel is '{name}', allowed is one of {', '.join(CHANNELS)}")
    return name


def main() -> None:
    """Run `solve`, unless the first word names another command.

    An input error prints one sentence and exits with status 2.
    """
    # Errors of images are reported by InputError, not by OpenCV's log.
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
    arguments = sys.argv[1:]
    commands = [
        command.callback.__name__ for command in app.registered_commands if command.callback
    ]
    if arguments and arguments[0] not in (*commands, "--help"):
        arguments = ["solve", *arguments]
    try:
        app(arguments)
    except InputError as error:
        console.print(f"error: {error}", markup=False)
        sys.exit(2)


if __name__ == "__main__":
    main()
