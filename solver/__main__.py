"""Command line of the solver: `python -m solver OBSERVATIONS --method exact_fit`."""

import sys
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
from solver.lab.check import checked
from solver.lab.console import busy, console, table, watched
from solver.lab.controls import NO_CONTROLS, Controls, controls_of
from solver.lab.live import answers, json_line, warm_up
from solver.lab.overlay import OverlayWriter, draw
from solver.lab.shots import Files, Source
from solver.lab.sources import open_source
from solver.lab.table import Row, csv_text
from solver.lab.target import svg
from solver.lab.writing import make_room, write
from solver.methods import METHODS
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
        help=f"what of colour images is read: {', '.join(CHANNELS)}",
        show_default="camera.channel of rig.json, or gray",
    ),
]
SizeOption = Annotated[str | None, typer.Option(help="of a camera's images: WIDTHxHEIGHT")]
ExposureOption = Annotated[
    float | None, typer.Option(help="of a camera, by hand, in its own unit", show_default="auto")
]
ControlOption = Annotated[
    list[str] | None,
    typer.Option(help="any of OpenCV's camera properties: gain=4, fourcc=Y16; may be repeated"),
]


@app.command()
def solve(
    sources: Annotated[
        list[str],
        typer.Argument(help="a folder of observations; or images, a video, a camera, with --rig"),
    ],
    rig: Annotated[
        Path | None, typer.Option(help="rig.json, with calibration/ and rest/ images beside it")
    ] = None,
    method: Annotated[
        str, typer.Option(help=f"{', '.join(METHODS)}, or package.module:function")
    ] = "exact_fit",
    centreline: Annotated[
        str, typer.Option(help=f"how the beam is measured: {', '.join(EXTRACTORS)}")
    ] = "profile_fit",
    readings: Annotated[
        Path | None, typer.Option(help="table like metadata.csv that lies beside the images")
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(help="CSV to write", show_default="estimates_<method>.csv, of a camera none"),
    ] = None,
    stream: Annotated[
        bool, typer.Option("--stream", help="one line of JSON a frame on stdout, as they come")
    ] = False,
    overlay: Annotated[
        Path | None, typer.Option(help="folder, .mp4 or .avi for images with what was seen")
    ] = None,
    channel: ChannelOption = None,
    size: SizeOption = None,
    exposure: ExposureOption = None,
    control: ControlOption = None,
    repeats: Annotated[
        int, typer.Option(min=1, help="solve each frame this often and state the median time")
    ] = 1,
    quiet: Annotated[bool, typer.Option(help="no table, no progress")] = False,
) -> None:
    """Estimate contact and force in every frame: a table and a CSV, or a stream of JSON."""
    function, learn = find_method(method), find_extractor(centreline)
    controls = controls_of(size, exposure, control or ())
    opened, source = _open(sources, rig, readings, channel, controls)
    target = out or (
        None if source.live or stream else Path(f"estimates_{method.replace(':', '.')}.csv")
    )
    if target:
        make_room(target)
    with busy("calibrating; the first run on a computer compiles, which takes a while", quiet):
        antenna = set_up(opened, learn)
        warm_up(antenna, function, next(opened.read_rest_images()))
    rows: dict[int, Row] = {}
    interrupted = False
    try:
        with ExitStack() as stack:
            writer = stack.enter_context(OverlayWriter(overlay, source.rate)) if overlay else None
            given = stack.enter_context(closing(answers(source, antenna, function, repeats)))
            for answer in stack.enter_context(watched(given, source, quiet or stream)):
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
        kept = [rows[number] for number in sorted(rows)]
        if target and kept:
            write(target, csv_text(kept).encode())
    if target and not (quiet or stream):
        Console().print(table(kept, method))
        Console(soft_wrap=True).print(f"{len(kept)} estimates in {target}", markup=False)
    if interrupted and not source.live:  # Ctrl-C is how a camera is switched off
        console.print("interrupted: what was solved until then is kept")
        raise typer.Exit(130)


@app.command()
def board(
    out: Annotated[Path, typer.Argument(help="SVG to write")],
    rig: Annotated[Path, typer.Option(help="rig.json, of which the board is read")],
) -> None:
    """Draw the rig's calibration board in its true size, to be printed at 100 %."""
    write(out, svg(read_rig(rig_file(rig)).board).encode())


@app.command()
def snap(
    source: Annotated[str, typer.Argument(help="a camera, or an image to be made gray")],
    out: Annotated[Path, typer.Argument(help="PNG to write, such as rest/rest_00.png")],
    rig: Annotated[Path | None, typer.Option(help="rig.json, whose camera.channel is kept")] = None,
    channel: ChannelOption = None,
    size: SizeOption = None,
    exposure: ExposureOption = None,
    control: ControlOption = None,
    drop: Annotated[
        int,
        typer.Option(min=0, help="first frames of a camera not to keep: its exposure settles"),
    ] = 30,
) -> None:
    """Keep one image of a camera as a gray PNG: of the board, or of the beam at rest."""
    kept = _channel(channel) or (read_rig(rig_file(rig)).channel if rig else "gray")
    controls = controls_of(size, exposure, control or ())
    opened = open_source([source], channel=kept, controls=controls)
    make_room(out)
    shot = next(shot for shot in opened if not opened.live or shot.number >= drop)
    write(out, png_bytes(shot.grey()))


@app.command()
def check(
    rig: RigOption,
    json: Annotated[bool, typer.Option("--json", help="the figures as one line of JSON")] = False,
) -> None:
    """Say how good the calibration is, and what the images at rest have taught."""
    facts = checked(set_up(open_rig(rig)))
    print(facts.json() if json else facts.text())


@app.command()
def rigidity(
    images: Annotated[list[str], typer.Argument(help="images of the beam under the weight")],
    rig: RigOption,
    weight_g: Annotated[float, typer.Option(min=0, help="the weight, thread included")],
    at_mm: Annotated[float, typer.Option(min=0, help="where it hangs, along the beam")],
    weight_sigma_g: Annotated[float, typer.Option(min=0)] = 0.01,
    at_sigma_mm: Annotated[float, typer.Option(min=0)] = 0.5,
    level_sigma_deg: Annotated[
        float, typer.Option(min=0, help="how well the clamp is known to be level")
    ] = 0.5,
    gravity_m_s2: Annotated[float, typer.Option(min=0, help="of your place")] = 9.807,
) -> None:
    """Find EI from a weight that hangs on the beam, in the plane of the calibration board."""
    if weight_g == 0 or gravity_m_s2 == 0:
        raise InputError("--weight-g and --gravity-m-s2 are above 0")
    opened, source = _open(images, rig, None, None, NO_CONTROLS)
    if source.live:
        raise InputError("EI is found from images: keep some with the command snap")
    antenna = set_up(opened)
    # The sag at rest is a load to be fitted, not a bow to be subtracted.
    at_rest = antenna.at_rest
    antenna = replace(antenna, at_rest=replace(at_rest, rest=at_rest.rest.without_bow()))

    def measured(image: Grey) -> Measurement:
        return to_measurement(antenna, extract_centreline(antenna, image))

    newton = gravity_m_s2 / 1e3
    found = flexural_rigidity(
        [measured(image) for image in opened.read_rest_images()],
        [measured(shot.grey()) for shot in source],
        HungWeight(
            force=weight_g * newton,
            force_sigma=weight_sigma_g * newton,
            at=at_mm * MILLIMETRE,
            at_sigma=at_sigma_mm * MILLIMETRE,
            level_sigma=level_sigma_deg * DEGREE,
        ),
    )
    value, sigma = found.value / NEWTON_SQUARE_MILLIMETRE, found.sigma / NEWTON_SQUARE_MILLIMETRE
    nominal = opened.rig.beam.flexural_rigidity / NEWTON_SQUARE_MILLIMETRE
    say = Console(highlight=False, soft_wrap=True)
    say.print(
        f"EI = {value:.5g} +- {sigma:.2g} N mm^2 ({100 * sigma / value:.2g} %), "
        f"{100 * (value / nominal - 1):+.2f} % from the rig's {nominal:.5g}.\n"
        f"The shape puts the weight at {found.at / MILLIMETRE:.2f} "
        f"+- {found.at_sigma / MILLIMETRE:.2f} mm; by its own weight the tip sags "
        f"{abs(found.sag) / MILLIMETRE:.2f} mm; points err by {found.misfit:.2g} sigma.\n"
        f"In {rig_file(rig)}, under beam, write\n"
        f'    "flexural_rigidity_n_mm2": {value:.6g},\n'
        f'    "flexural_rigidity_sigma_n_mm2": {sigma:.3g},',
        markup=False,
    )


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
        opened = open_rig(rig)
        kept = _channel(channel) or opened.rig.channel
        opened = replace(opened, rig=replace(opened.rig, channel=kept))
        return opened, open_source(sources, readings, kept, controls)
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
    opened = open_observations(root)
    return opened, Files(opened.frames)


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
    words = sys.argv[1:]
    named = [command.callback.__name__ for command in app.registered_commands if command.callback]
    if words and words[0] not in (*named, "--help"):
        words = ["solve", *words]
    try:
        app(words)
    except InputError as error:
        console.print(f"error: {error}", markup=False)
        sys.exit(2)


if __name__ == "__main__":
    main()
