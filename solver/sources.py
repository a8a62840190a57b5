"""What a command line names: a rig with its images, and where frames come from."""

from collections.abc import Sequence
from pathlib import Path
from typing import Final

from solver.capture import Camera, Video, open_capture
from solver.instrument.errors import InputError
from solver.instrument.images import png_size
from solver.instrument.observation import Frame, Observations
from solver.instrument.observation import _frames as frames_of
from solver.instrument.rig import read_rig
from solver.shots import Files, Source

VIDEOS: Final = (".avi", ".m4v", ".mkv", ".mov", ".mp4", ".mpeg", ".mpg", ".webm", ".wmv")


def rig_file(path: Path) -> Path:
    """A rig.json itself, or that in a folder."""
    return path / "rig.json" if path.is_dir() else path


def open_rig(path: Path) -> Observations:
    """A rig.json, or the folder it lies in, with the images of the board and of the beam at rest.

    They lie beside it as calibration/view_*.png and rest/rest_*.png; there are no frames.
    Raises InputError.
    """
    rig, root = read_rig(rig_file(path)), rig_file(path).parent
    images = {
        name: tuple(sorted(root.glob(name)))
        for name in ("calibration/view_*.png", "rest/rest_*.png")
    }
    for name, found in images.items():
        if not found:
            raise InputError(f"{root}: holds no {name}, at least one is needed")
    views, rests = images.values()
    expected = png_size(views[0])
    for image in (*views, *rests):
        size = png_size(image)
        if size != expected:
            raise InputError(
                f"{image}: has {size[0]} x {size[1]} px, allowed is the size of "
                f"{views[0].name}, {expected[0]} x {expected[1]} px"
            )
    return Observations(root, rig, views, rests, ())


def open_source(names: Sequence[str], readings: Path | None = None) -> Source:
    """Images, or one video, or one camera (its number or address).

    `readings` is a table as an observations tree has it, lying beside the images. Raises
    InputError.
    """
    only = names[0] if len(names) == 1 else ""
    if only.isdecimal() or "://" in only or only.startswith("/dev/"):
        return Camera(f"camera {only}", open_capture(int(only) if only.isdecimal() else only))
    if Path(only).suffix.lower() in VIDEOS:
        if not Path(only).is_file():
            raise InputError(f"{only}: there is no such video")
        return Video(only, open_capture(only))
    for name in names:
        if Path(name).is_dir():
            raise InputError(f"{name}: is a folder, name the images in it: {name}/*.png")
        if not Path(name).is_file():
            raise InputError(f"{name}: there is no such image")
        if Path(name).suffix.lower() in VIDEOS:
            raise InputError(f"{name}: one video at a time")
    paths = [Path(name) for name in names]
    read = {} if readings is None else {f.path.resolve(): f for f in frames_of(readings)}
    frames = []
    for path in paths:
        known = read.get(path.resolve())
        if readings is not None and known is None:
            raise InputError(f"{readings}: holds no row for {path.name}")
        frames.append(
            Frame(str(path), path)
            if known is None
            else Frame(str(path), path, known.readings, known.push_id, known.step)
        )
    return Files(frames)
