"""Options that several commands share, and the inputs that they open."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated, NamedTuple

import typer

from solver.antenna import Antenna
from solver.centreline.extractors import EXTRACTORS
from solver.instrument.by_name import ELSEWHERE
from solver.instrument.errors import InputError
from solver.instrument.images import CHANNELS, image_files
from solver.instrument.observation import (
    Observations,
    frames_beside,
    open_observations,
    open_rig_files,
    rig_file,
    tables_beside,
)
from solver.lab.controls import NO_CONTROLS, Controls
from solver.lab.file_findings import file_findings
from solver.lab.findings import Finding, findings
from solver.lab.shots import Files, Source
from solver.lab.sources import is_camera, open_source
from solver.methods import METHODS

_RIG = typer.Option(help="rig.json, with calibration/ and rest/ images beside it")
RigOption = Annotated[Path, _RIG]
# Without it, the source is a folder of observations, which holds its own rig.json.
OtherRigOption = Annotated[Path | None, _RIG]
ReadingsOption = Annotated[
    Path | None, typer.Option(help="table like metadata.csv, in the folder of the images")
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

MethodOption = Annotated[str, typer.Option(help=f"{', '.join(METHODS)}, or {ELSEWHERE}")]
CentrelineOption = Annotated[str, typer.Option(help=f"{', '.join(EXTRACTORS)}, or {ELSEWHERE}")]
BeamOption = Annotated[
    str | None,
    typer.Option(help=f"beam of your own for the method: {ELSEWHERE}", show_default=False),
]
PageOption = Annotated[Path | None, typer.Option("--page", help="HTML page with pictures to write")]
JsonOption = Annotated[bool, typer.Option("--json", help="print one line of JSON")]


class Inputs(NamedTuple):
    """Rig with its images, source of frames, tables of readings, and all files that are read.

    Images are also the frames of the observations; of a rig's folder, they are those beside its
    rig.json. `rig` is the path to check the rig with.
    """

    observations: Observations
    source: Source
    rig: Path
    tables: tuple[Path, ...]
    files: tuple[Path, ...]

    def findings(self, antenna: Antenna) -> tuple[Finding, ...]:
        """List what contradicts the rig in its files and in its images. Raises InputError."""
        return (*file_findings(self.observations, self.tables), *findings(antenna))


def open_inputs(
    sources: list[str],
    rig: Path | None,
    readings: Path | None,
    channel: str | None,
    controls: Controls,
) -> Inputs:
    """Open what the options name.

    `channel` replaces the rig's, for images at rest and for frames. Raises InputError.
    """
    observations, source = _opened(sources, rig, readings, channel, controls)
    folder, root = Path(sources[0]), observations.root
    tables = tables_beside(folder) if readings is None and folder.is_dir() else []
    tables += [] if readings is None else [readings]
    files = (
        rig_file(rig or root),
        root / "rig.json",
        *observations.board_views,
        *observations.rest_images,
        *observations.ground_images,
        *(frame.path for frame in observations.frames),
        *tables,
        *tables_beside(root),
        *map(Path, sources),
    )
    return Inputs(observations, source, rig or root, tuple(tables), files)


def _opened(
    sources: list[str],
    rig: Path | None,
    readings: Path | None,
    channel: str | None,
    controls: Controls,
) -> tuple[Observations, Source]:
    if rig is not None:
        observations = open_rig_files(rig)
        used_channel = checked_channel(channel) or observations.rig.channel
        observations = replace(observations, rig=replace(observations.rig, channel=used_channel))
        source = (
            Files(frames_beside(Path(sources[0]), used_channel))
            if readings is None and controls == NO_CONTROLS and _is_rig_folder(sources)
            else open_source(sources, readings, used_channel, controls)
        )
        frames = source.frames if isinstance(source, Files) else ()
        return replace(observations, frames=frames), source
    root = Path(sources[0])
    if not (root.exists() or is_camera(sources[0])):
        raise InputError(f"{root}: does not exist")
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


def _is_rig_folder(sources: list[str]) -> bool:
    """Return whether the only source is a folder with rig.json and images of pushes."""
    root = Path(sources[0])
    return (
        len(sources) == 1
        and (root / "rig.json").is_file()
        and bool(tables_beside(root) or image_files(root / "images"))
    )


def checked_channel(name: str | None) -> str | None:
    """Check the option --channel. Raises InputError."""
    if name is not None and name not in CHANNELS:
        raise InputError(f"--channel is '{name}', allowed is one of {', '.join(CHANNELS)}")
    return name
