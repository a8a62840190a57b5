"""Opening of a source of frames that is named on the command line."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

from solver.instrument.errors import InputError
from solver.instrument.image_frame import ImageFrame
from solver.instrument.metadata import read_frames
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
    single_name = names[0] if len(names) == 1 else ""
    if single_name.isdecimal() or "://" in single_name or single_name.startswith("/dev/"):
        name = f"camera {single_name}"
        capture = open_capture(int(single_name) if single_name.isdecimal() else single_name)
        set_controls(capture, controls, name)
        return CameraStream(name, capture, channel)
    if controls != NO_CONTROLS:
        raise InputError(f"{names[0]}: is not a camera; size, exposure and controls need one")
    if Path(single_name).suffix.lower() in VIDEOS:
        if not Path(single_name).is_file():
            raise InputError(f"{single_name}: does not exist")
        return Video(single_name, open_capture(single_name), channel)
    for name in names:
        if Path(name).is_dir():
            if list(Path(name).glob("*.png")):
                raise InputError(f"{name}: is a folder, list its images: {name}/*.png")
            raise InputError(f"{name}: is a folder without PNG images, allowed are images")
        if not Path(name).is_file():
            raise InputError(f"{name}: does not exist")
        if Path(name).suffix.lower() in VIDEOS:
            raise InputError(f"{name}: one video at a time")
    paths = [Path(name) for name in names]
    frames_by_path = (
        {} if readings is None else {f.path.resolve(): f for f in read_frames(readings)}
    )
    frames = []
    for path in paths:
        frame = frames_by_path.get(path.resolve())
        if readings is not None and frame is None:
            raise InputError(f"{readings}: holds no row for {path.name}")
        frames.append(
            ImageFrame(str(path), path, channel=channel)
            if frame is None
            else replace(frame, frame_id=str(path), path=path, channel=channel)
        )
    return Files(frames)
