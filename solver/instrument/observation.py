"""The observations tree: all that a solver ever sees.

observations/
  rig.json                      nominal rig with tolerances
  calibration/view_00.png ...   board views; view 0 lies in plane C
  rest/rest_00.png ...          the beam before contact
  shard_00000/metadata.csv      file_name, frame_id, motor_angle_deg
  shard_00000/<frame_id>.png    one image a frame
  hashes.json                   sha256 of every file (of generated trees)
  INCOMPLETE                    stands there while a tree is being made
"""

import csv
import io
import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from solver.instrument.arrays import Grey
from solver.instrument.errors import InputError
from solver.instrument.images import png_size, read_grey
from solver.instrument.rig import Rig, read_rig
from solver.instrument.units import DEGREE

INCOMPLETE = "INCOMPLETE"


@dataclass(frozen=True)
class Frame:
    """One image of the pushing beam: where it lies and what the encoder read [rad]."""

    frame_id: str
    path: Path
    motor_angle: float

    def image(self) -> Grey:
        """The gray image (height, width). Raises InputError."""
        return read_grey(self.path)


@dataclass(frozen=True)
class Observations:
    """An opened observations tree. Images are read when asked for."""

    root: Path
    rig: Rig
    board_views: tuple[Path, ...]
    rest_images: tuple[Path, ...]
    frames: tuple[Frame, ...]

    def __iter__(self) -> Iterator[Frame]:
        return iter(self.frames)


def open_observations(root: Path) -> Observations:
    """Open the tree at `root`. Raises InputError where it is missing, broken or incomplete."""
    if not root.is_dir():
        raise InputError(f"{root}: is not a folder of observations")
    if (root / INCOMPLETE).exists():
        raise InputError(
            f"{root}: is incomplete; run the command that was making it again to finish it"
        )
    rig = read_rig(root / "rig.json")
    board_views = tuple(sorted(root.glob("calibration/view_*.png")))
    rest_images = tuple(sorted(root.glob("rest/rest_*.png")))
    for name, images in (("calibration/view_*.png", board_views), ("rest/rest_*.png", rest_images)):
        if not images:
            raise InputError(f"{root}: holds no {name}, at least one is needed")
    frames = tuple(
        frame for table in sorted(root.glob("shard_*/metadata.csv")) for frame in _frames(table)
    )
    if not frames:
        raise InputError(f"{root}: holds no frames (shard_*/metadata.csv)")
    expected = png_size(board_views[0])
    for path in (*board_views, *rest_images, *(frame.path for frame in frames)):
        size = png_size(path)
        if size != expected:
            raise InputError(
                f"{path}: has {size[0]} x {size[1]} px, allowed is the size of "
                f"{board_views[0].name}, {expected[0]} x {expected[1]} px"
            )
    return Observations(root, rig, board_views, rest_images, frames)


def _frames(table: Path) -> Iterator[Frame]:
    try:
        text = table.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{table}: cannot be read as UTF-8 text ({error})") from error
    for line, row in enumerate(csv.DictReader(io.StringIO(text, newline="")), start=2):
        try:
            path = table.parent / row["file_name"]
            frame_id, angle = row["frame_id"], float(row["motor_angle_deg"])
        except (KeyError, TypeError, ValueError) as error:
            raise InputError(
                f"{table}:{line}: needs file_name, frame_id and a number motor_angle_deg"
            ) from error
        if not math.isfinite(angle):
            raise InputError(f"{table}:{line}: motor_angle_deg is {angle}, allowed is finite")
        if not path.is_file():
            raise InputError(f"{table}:{line}: the image {path.name} is missing")
        yield Frame(frame_id, path, angle * DEGREE)
