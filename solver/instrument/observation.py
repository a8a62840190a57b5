"""The observations tree: the complete input of a solver.

observations/
  rig.json                      nominal rig with tolerances
  calibration/view_00.png ...   board views; view 0 lies in plane C
  rest/rest_00.png ...          the beam before contact
  shard_00000/metadata.csv      one row per frame; columns below
  shard_00000/<frame_id>.png    one image per frame
  hashes.json, shard_00000/hashes.json   of generated trees: see solver/instrument/hashes.py

Columns of metadata.csv: file_name, frame_id (by default the file's stem) and motor_angle_deg, which
is empty if there is no encoder. Optional columns: push_id and step (frames of one push, in order),
removed_from_mm and removed_to_mm (an interval of Sigma_a's x axis to be left out), moment_y_n_mm
(the moment sensor), base_force_{x,y,z}_n and base_moment_{x,y,z}_n_mm (the force sensor: force and
moment of the clamp on the beam, in Sigma_a).
"""

import csv
import io
import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path, PurePath
from typing import Final

from solver.instrument.arrays import Grey
from solver.instrument.errors import InputError, quoted, truncated
from solver.instrument.hashes import listed, read_bytes, read_hashes
from solver.instrument.images import png_head, read_grey
from solver.instrument.rig import Rig, read_rig
from solver.instrument.units import DEGREE, MILLIMETRE

# Longest name in a table. Chosen: file names can have 255 characters, suffix included.
MAX_NAME_LENGTH: Final = 250
# Chosen: enough frames to detect a tree of mixed depths, and opening stays fast.
CHECKED_FRAMES: Final = 8


@dataclass(frozen=True)
class Readings:
    """Readings that belong to an image; each is None if it does not exist.

    `motor_angle` [rad] is the encoder's reading. `removed` [m] is an interval of Sigma_a's x axis
    to be left out. `moment_y` [N m], `base_force` (3,) [N] and `base_moment` (3,) [N m] are sensor
    readings.
    """

    motor_angle: float | None = None
    removed: tuple[float, float] | None = None
    moment_y: float | None = None
    base_force: tuple[float, float, float] | None = None
    base_moment: tuple[float, float, float] | None = None


NO_READINGS = Readings()


@dataclass(frozen=True)
class ImageFrame:
    """One image of the pushing beam: its path and the readings taken with it.

    Frames of one push share `push_id` and are ordered by `step`. `channel` is the channel read from
    a colour image.
    """

    frame_id: str
    path: Path
    readings: Readings = NO_READINGS
    push_id: str = ""
    step: int = 0
    channel: str = "gray"

    def image(self) -> Grey:
        """Read the gray image (height, width). Raises InputError."""
        return read_grey(self.path, self.channel)


@dataclass(frozen=True)
class Observations:
    """Opened observations tree. Images are read on request."""

    root: Path
    rig: Rig
    board_views: tuple[Path, ...]
    rest_images: tuple[Path, ...]
    frames: tuple[ImageFrame, ...]

    def __iter__(self) -> Iterator[ImageFrame]:
        """Iterate over the frames, ordered by push and step."""
        return (self.frames[i] for i in push_order(self.frames))

    def read_board_views(self) -> Iterator[Grey]:
        """Read the board views one by one, in gray. Raises InputError."""
        return (read_grey(path) for path in self.board_views)

    def read_rest_images(self) -> Iterator[Grey]:
        """Read the rest images one by one, with the same channel as frames. Raises InputError."""
        return (read_grey(path, self.rig.channel) for path in self.rest_images)


def push_order(frames: Sequence[ImageFrame]) -> list[int]:
    """Sort the indices of frames by push, in the order of their first frames, then by step."""
    first = {frame.push_id: i for i, frame in reversed(list(enumerate(frames)))}
    return sorted(range(len(frames)), key=lambda i: (first[frames[i].push_id], frames[i].step))


def open_observations(root: str | Path) -> Observations:
    """Open the tree at `root`. Raises InputError if it is missing, broken or incomplete.

    From a generated tree, only the files listed in its hashes.json are used. Images of frames are
    checked when they are read.
    """
    root = Path(root)
    if not root.is_dir():
        raise InputError(f"{root}: is not a folder of observations")
    names = listed(root)
    opened = open_rig(root)
    if names is None:
        tables = sorted(root.glob("shard_*/metadata.csv"))
    else:
        tables = [root / name for name in names if PurePath(name).match("shard_*/metadata.csv")]
    frames = tuple(
        replace(frame, channel=opened.rig.channel)
        for table in tables
        for frame in read_frames(table)
    )
    if not frames:
        raise InputError(f"{root}: holds no frames (shard_*/metadata.csv)")
    name, count = Counter(frame.frame_id for frame in frames).most_common(1)[0]
    if count > 1:
        raise InputError(
            f"{root}: {count} frames have the frame_id {quoted(name)}, allowed is one each"
        )
    _check_bit_depth(opened.rest_images[0], frames)
    return replace(opened, frames=frames)


def _check_bit_depth(rest_image: Path, frames: Sequence[ImageFrame]) -> None:
    """Raise InputError if none of the first frames has the depth of the rest image.

    A single frame that differs or cannot be read is reported in its own estimate.
    """
    bits, depths = png_head(rest_image).bits, set[int]()
    for frame in frames[:CHECKED_FRAMES]:
        try:
            depths.add(png_head(frame.path).bits)
        except InputError:
            return
    if bits not in depths:
        raise InputError(
            f"{frames[0].path}: has {depths.pop()} bits and {rest_image.name} {bits}; "
            "allowed are frames and rest images of one depth"
        )


def rig_file(path: Path) -> Path:
    """Return the path of a rig.json, given itself or its folder."""
    return path / "rig.json" if path.is_dir() else path


def open_rig(path: Path) -> Observations:
    """Open a rig.json, or its folder, with the board views and the rest images.

    These are beside it as calibration/view_*.png and rest/rest_*.png, all of one size. The result
    has no frames. Raises InputError.
    """
    rig, root = read_rig(rig_file(path)), rig_file(path).parent
    patterns, hashes = ("calibration/view_*.png", "rest/rest_*.png"), read_hashes(root)
    views, rests = (
        tuple(
            sorted(root.glob(pattern))
            if hashes is None
            else [root / name for name in sorted(hashes) if PurePath(name).match(pattern)]
        )
        for pattern in patterns
    )
    for name, paths in zip(patterns, (views, rests), strict=True):
        if not paths:
            raise InputError(f"{root}: holds no {name}, at least one is needed")
    expected = png_head(views[0])
    for image in (*views, *rests):
        size = png_head(image)
        if size[:2] != expected[:2]:
            raise InputError(
                f"{image}: has {size.width} x {size.height} px, allowed is the size of "
                f"{views[0].name}, {expected.width} x {expected.height} px"
            )
    depths = {image: png_head(image).bits for image in rests}
    for image, bits in depths.items():
        if bits != depths[rests[0]]:
            raise InputError(
                f"{image}: has {bits} bits and {rests[0].name} {depths[rests[0]]}; "
                "allowed are rest images of one depth"
            )
    return Observations(root, rig, views, rests, ())


def read_frames(table: Path) -> Iterator[ImageFrame]:
    """Read the frames of a metadata.csv, which is in the folder of their images.

    Columns are separated by commas or, as written by some versions of Excel, by semicolons.
    Raises InputError.
    """
    try:
        text = read_bytes(table).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"{table}: cannot be read as UTF-8 text ({error})") from error
    for line, row in _rows(table, text):
        cells = _Cells(f"{table}:{line}", row)
        path = cells.image(table.parent)
        removed = cells.numbers("removed_from_mm", "removed_to_mm")
        if removed is not None and removed[0] > removed[1]:
            raise InputError(
                f"{table}:{line}: removed_from_mm is {removed[0]:g} and removed_to_mm "
                f"{removed[1]:g}, allowed is from low to high"
            )
        force = cells.numbers(*(f"base_force_{axis}_n" for axis in "xyz"))
        moment = cells.numbers(*(f"base_moment_{axis}_n_mm" for axis in "xyz"))
        angle = cells.numbers("motor_angle_deg")
        moment_y = cells.numbers("moment_y_n_mm")
        readings = Readings(
            motor_angle=None if angle is None else angle[0] * DEGREE,
            removed=None if removed is None else (removed[0] * MILLIMETRE, removed[1] * MILLIMETRE),
            moment_y=None if moment_y is None else moment_y[0] * MILLIMETRE,
            base_force=None if force is None else (force[0], force[1], force[2]),
            base_moment=None
            if moment is None
            else (moment[0] * MILLIMETRE, moment[1] * MILLIMETRE, moment[2] * MILLIMETRE),
        )
        yield ImageFrame(
            frame_id=cells.name("frame_id") or path.stem,
            path=path,
            readings=readings,
            push_id=cells.name("push_id"),
            step=cells.count("step"),
        )


def _rows(table: Path, text: str) -> Iterator[tuple[int, dict[str, str | None]]]:
    """Yield each row with its line number."""
    head = text.partition("\n")[0]
    separator = ";" if ";" in head and "," not in head else ","
    reader = csv.DictReader(io.StringIO(text, newline=""), delimiter=separator)
    try:
        for row in reader:
            yield reader.line_num, row
    except csv.Error as error:
        raise InputError(f"{table}:{reader.line_num + 1}: is not CSV ({error})") from error


@dataclass(frozen=True)
class _Cells:
    """Row of metadata.csv, and its location for messages."""

    where: str
    row: dict[str, str | None]

    def image(self, folder: Path) -> Path:
        """Return the path of the row's image, which is in `folder` or a subfolder."""
        value = self.row.get("file_name")
        if not value:
            raise InputError(f"{self.where}: file_name is missing")
        path = Path(value)
        if path.is_absolute() or ".." in path.parts:
            raise InputError(
                f"{self.where}: file_name is {quoted(value)}, allowed is a file beside the table"
            )
        try:
            exists = (folder / path).is_file()
        except OSError:  # an invalid file name
            exists = False
        if not exists:
            raise InputError(f"{self.where}: the image {truncated(path.name)} is missing")
        return folder / path

    def name(self, column: str) -> str:
        """Read a short text; return an empty one if there is none."""
        value = self.row.get(column) or ""
        if len(value) > MAX_NAME_LENGTH:
            raise InputError(
                f"{self.where}: {column} has {len(value)} characters, allowed are {MAX_NAME_LENGTH}"
            )
        return value

    def count(self, name: str) -> int:
        """Read a whole number from 0; an empty cell is 0."""
        value = (self.numbers(name) or [0.0])[0]
        if value < 0 or value != int(value):
            raise InputError(f"{self.where}: {name} is {value:g}, allowed is a whole number >= 0")
        return int(value)

    def numbers(self, *names: str) -> list[float] | None:
        """Read finite numbers from columns that belong together; return None if all are empty."""
        texts = [self.row.get(name) or "" for name in names]
        if not any(texts):
            return None
        values = []
        for name, text in zip(names, texts, strict=True):
            try:
                value = float(text)
            except ValueError:
                value = math.nan
            if not math.isfinite(value):
                raise InputError(
                    f"{self.where}: {name} is {quoted(text)}, allowed is a finite number"
                )
            values.append(value)
        return values
