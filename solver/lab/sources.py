"""Opening of a source of frames that is named on the command line."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

from solver.instrument.errors import InputError
from solver.instrument.image_frame import ImageFrame
from solver.instrument.images import STACKS, image_files, page_count
from solver.instrument.metadata import read_frames
from solver.lab.capture import CameraStream, Stack, Video, open_capture
from solver.lab.controls import NO_CONTROLS, Controls, set_controls
from solver.lab.shots import Files, Source

VIDEOS: Final = (".avi", ".m4v", ".mkv", ".mov", ".mp4", ".mpeg", ".mpg", ".webm", ".wmv")


def is_camera(name: str) -> bool:
    """Return whether a source is a camera: its number, address or device."""
    return name.isdecimal() or "://" in name or name.startswith("/dev/")


def open_source(
    names: Sequence[str],
    readings: Path | None = None,
    channel: str = "gray",
    controls: Controls = NO_CONTROLS,
) -> Source:
    """Open images, one video, one film in a TIFF or GIF file, or one camera.

    A camera is named by its number or address. `readings` is a table as in an observations tree, in
    the folder of the images; `channel` is the channel read from colour images; `controls` are set
    on a camera. Raises InputError.
    """
    single_name = names[0] if len(names) == 1 else ""
    if is_camera(single_name):
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
        _check_image_file(Path(name))
    paths = [Path(name) for name in names]
    if len(paths) == 1 and paths[0].suffix.lower() in STACKS and page_count(paths[0]) > 1:
        if readings is not None:
            raise InputError(f"{single_name}: is a film, and a table of readings is for images")
        return Stack(paths[0], channel)
    frames_by_path = {} if readings is None else _by_path(readings)
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


def _by_path(readings: Path) -> dict[Path, ImageFrame]:
    """Return the frames of a table of readings. Raises InputError for two of one image."""
    found: dict[Path, ImageFrame] = {}
    for frame in read_frames(readings):
        path = frame.path.resolve()
        if path in found:
            raise InputError(f"{readings}: holds two rows for {frame.path.name}, allowed is one")
        found[path] = frame
    return found


def _check_image_file(path: Path) -> None:
    if path.is_dir():
        for folder in (path, path / "images"):
            if images := image_files(folder):
                listing = f"{folder}/*{images[0].suffix}"
                raise InputError(f"{path}: is a folder, list its images: {listing}")
        raise InputError(f"{path}: is a folder without images, allowed are images")
    if not path.is_file():
        raise InputError(f"{path}: does not exist")
    if path.suffix.lower() in VIDEOS:
        raise InputError(f"{path}: one video at a time")
