"""Opening of a source of frames that is named on the command line."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

from solver.instrument.errors import InputError
from solver.instrument.observation import ImageFrame, read_frames
from solver.lab.capture import CameraStream, Video, open_capture
from solver.lab.controls import NO_CONTROLS, Controls, set_controls
from solver.lab.shots import Files, Source

VIDEOS: Final = (".avi", ".m4v", ".mkv", ".mov", ".mp4", ".mpeg", ".mpg", ".webm", ".wmv")


def open_source(
    names: Sequence[str],
    readings: Path | None = None,
    channel: str = "gray",
    controls: Controls = NO_CONTROLS,
) -> Source:
    """Open images, or one video, or one camera (its number or address).

    `readings` is a table as in an observations tree, in the folder of the images; `channel` is the
    channel read from colour images; `controls` are set on a camera. Raises InputError.
    """
    only = names[0] if len(names) == 1 else ""
    if only.isdecimal() or "://" in only or only.startswith("/dev/"):
        name = f"camera {only}"
        capture = open_capture(int(only) if only.isdecimal() else only)
        set_controls(capture, controls, name)
        return CameraStream(name, capture, channel)
    if controls != NO_CONTROLS:
        raise InputError(f"{names[0]}: is no camera, whose size, exposure or controls could be set")
    if Path(only).suffix.lower() in VIDEOS:
        if not Path(only).is_file():
            raise InputError(f"{only}: there is no such video")
        return Video(only, open_capture(only), channel)
    for name in names:
        if Path(name).is_dir():
            raise InputError(f"{name}: is a folder, name the images in it: {name}/*.png")
        if not Path(name).is_file():
            raise InputError(f"{name}: there is no such image")
        if Path(name).suffix.lower() in VIDEOS:
            raise InputError(f"{name}: one video at a time")
    paths = [Path(name) for name in names]
    read = {} if readings is None else {f.path.resolve(): f for f in read_frames(readings)}
    frames = []
    for path in paths:
        known = read.get(path.resolve())
        if readings is not None and known is None:
            raise InputError(f"{readings}: holds no row for {path.name}")
        frames.append(
            ImageFrame(str(path), path, channel=channel)
            if known is None
            else replace(known, frame_id=str(path), path=path, channel=channel)
        )
    return Files(frames)
