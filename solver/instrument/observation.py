"""The observations tree: the complete input of a solver.

observations/
  rig.json                      nominal rig with tolerances
  calibration/view_00.png ...   board views; view 0 lies in plane C; a laboratory's may be JPEG,
                                TIFF or BMP, as all its images
  rest/rest_00.png ...          the beam before contact
  ground/ground_00.png ...      the ground before the beam is mounted, in the same place and light;
                                may be missing
  shard_00000/metadata.csv      one row per frame: see solver/instrument/metadata.py
  shard_00000/<frame_id>.png    one image per frame
  images/metadata.csv, images/*          of a laboratory, in place of shards; the table may be
                                         missing where there are no readings
  hashes.json, shard_00000/hashes.json   of generated trees: see solver/instrument/hashes.py
"""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path, PurePath
from typing import Final

from solver.instrument.arrays import Grey
from solver.instrument.errors import DamageError, InputError, quoted
from solver.instrument.hashes import MEND, listed, read_hashes
from solver.instrument.image_frame import ImageFrame, push_order
from solver.instrument.images import image_files, image_head, read_grey
from solver.instrument.metadata import read_frames
from solver.instrument.rig import Rig
from solver.instrument.rig_json import read_rig

# Chosen: enough frames to detect a tree of mixed depths, and opening stays fast.
CHECKED_FRAMES: Final = 8
# Folders of a rig's images and the first characters of their names: of the board, of the beam at
# rest, of the ground.
IMAGE_NAMES: Final = ("calibration/view_", "rest/rest_", "ground/ground_")


@dataclass(frozen=True)
class Observations:
    """Opened observations tree. Images are read on request."""

    root: Path
    rig: Rig
    board_views: tuple[Path, ...]
    rest_images: tuple[Path, ...]
    frames: tuple[ImageFrame, ...]
    ground_images: tuple[Path, ...] = ()

    def __iter__(self) -> Iterator[ImageFrame]:
        """Iterate over the frames, ordered by push and step."""
        return (self.frames[i] for i in push_order(self.frames))

    def read_board_views(self) -> Iterator[Grey]:
        """Read the board views one by one, in gray. Raises InputError."""
        return (read_grey(path) for path in self.board_views)

    def read_rest_images(self) -> Iterator[Grey]:
        """Read the rest images one by one, with the same channel as frames. Raises InputError."""
        return (read_grey(path, self.rig.channel) for path in self.rest_images)

    def read_ground_images(self) -> Iterator[Grey]:
        """Read the images of the ground one by one, with the same channel. Raises InputError."""
        return (read_grey(path, self.rig.channel) for path in self.ground_images)


def open_observations(root: str | Path) -> Observations:
    """Open the tree at `root`. Raises InputError if it is missing, broken or incomplete.

    From a generated tree, only the files listed in its hashes.json are used. A laboratory's frames
    may be in images/. Images of frames are checked when they are read.
    """
    root = Path(root)
    if not root.is_dir():
        raise InputError(f"{root}: is not a folder of observations")
    names = listed(root)
    opened = open_rig_files(root)
    frames = _frames(root, names, opened.rig.channel)
    if not frames:
        raise InputError(f"{root}: holds no frames (shard_*/metadata.csv, images/*.png)")
    name, count = Counter(frame.frame_id for frame in frames).most_common(1)[0]
    if count > 1:
        raise InputError(
            f"{root}: {count} frames have the frame_id {quoted(name)}, allowed is one each"
        )
    _check_bit_depth(opened.rest_images[0], frames)
    return replace(opened, frames=frames)


def frames_beside(root: Path, channel: str) -> tuple[ImageFrame, ...]:
    """List the frames in the folder of a rig.json, of which there may be none. Raises InputError.

    `channel` is the channel read from colour images.
    """
    return _frames(root, listed(root), channel)


def _frames(root: Path, names: Sequence[str] | None, channel: str) -> tuple[ImageFrame, ...]:
    """List the frames of a tree whose hashes.json lists `names`, None without one."""
    tables = _tables(root, names)
    frames = [frame for table in tables for frame in read_frames(table)]
    if not tables and names is None:
        frames = [ImageFrame(path.stem, path) for path in image_files(root / "images")]
    return tuple(replace(frame, channel=channel) for frame in frames)


def tables_beside(root: Path) -> list[Path]:
    """List the tables of readings in the folder of a rig.json, of which there may be none."""
    return _tables(root, listed(root))


def _tables(root: Path, names: Sequence[str] | None) -> list[Path]:
    """List the tables of a tree whose hashes.json lists `names`, None without one."""
    if names is None:
        return sorted([*root.glob("shard_*/metadata.csv"), *root.glob("images/metadata.csv")])
    return [root / name for name in names if PurePath(name).match("shard_*/metadata.csv")]


def _check_bit_depth(rest_image: Path, frames: Sequence[ImageFrame]) -> None:
    """Raise InputError if none of the first frames has the depth of the rest image.

    A single frame that differs or cannot be read is reported in its own estimate.
    """
    bits, depths = image_head(rest_image).bits, set[int]()
    for frame in frames[:CHECKED_FRAMES]:
        try:
            depths.add(image_head(frame.path).bits)
        except InputError:
            return
    if bits not in depths:
        raise InputError(
            f"{frames[0].path}: has {depths.pop()} bits and {rest_image.name} {bits}; "
            "allowed are frames and rest images of one depth"
        )


def rig_file(path: Path) -> Path:
    """Return the path of a rig.json, given itself or its folder.

    Raises InputError for a rig that was saved.
    """
    if path.suffix == ".npz":
        raise InputError(
            f"{path}: is a saved rig, which solver.load_rig reads; allowed here is a rig.json or "
            "its folder"
        )
    return path / "rig.json" if path.is_dir() else path


def open_rig_files(path: Path) -> Observations:
    """Open a rig.json, or its folder, with the board views and the rest images.

    These are beside it as calibration/view_* and rest/rest_*, and images of the ground without the
    beam as ground/ground_*, which may be missing; all are of one size. The result has no frames.
    Raises InputError, and DamageError if an image of a generated tree is missing.
    """
    rig, root = read_rig(rig_file(path)), rig_file(path).parent
    hashes = read_hashes(root)
    views, rests, grounds = (
        tuple(
            image_files(root / name.split("/")[0], name.split("/")[1])
            if hashes is None
            else [root / one for one in sorted(hashes) if PurePath(one).match(f"{name}*.png")]
        )
        for name in IMAGE_NAMES
    )
    for name, paths in zip(IMAGE_NAMES, (views, rests), strict=False):
        if not paths:
            raise InputError(f"{root}: holds no {name}*.png, at least one is needed")
    for image in (*views, *rests, *grounds):
        if hashes is not None and not image.is_file():
            raise DamageError(f"{image}: is missing; {MEND}")
    expected = image_head(views[0])
    for image in (*views, *rests, *grounds):
        size = image_head(image)
        if size[:2] != expected[:2]:
            raise InputError(
                f"{image}: has {size.width} x {size.height} px, allowed is the size of "
                f"{views[0].name}, {expected.width} x {expected.height} px"
            )
    depths = {image: image_head(image).bits for image in (*rests, *grounds)}
    for image, bits in depths.items():
        if bits != depths[rests[0]]:
            raise InputError(
                f"{image}: has {bits} bits and {rests[0].name} {depths[rests[0]]}; "
                "allowed are rest images of one depth"
            )
    return Observations(root, rig, views, rests, (), grounds)
