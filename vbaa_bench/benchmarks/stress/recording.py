"""One rig's observations in memory: read, changed by a perturbation, written as another tree."""

import shutil
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from solver.instrument.arrays import Floats, Grey
from solver.instrument.camera import Camera
from solver.instrument.files import write_text
from solver.instrument.images import png_bytes
from solver.instrument.observation import open_observations
from solver.instrument.rig import Rig
from solver.instrument.rig_json import rig_to_json

Images = tuple[Grey, ...]


class NotApplicableError(Exception):
    """Error for a perturbation that is impossible on this computer or rig, with the reason."""


@dataclass(frozen=True)
class Recording:
    """Stated rig, and the images of the board, of the beam at rest and of the pushes.

    `camera` is the true one before any perturbation; it gives the beam's position in the image.
    """

    rig: Rig
    boards: Images
    rests: Images
    frames: Images
    camera: Camera

    def each(self, change: Callable[[Grey], Grey]) -> "Recording":
        """Change every image."""
        return self.beams(change).only_boards(change)

    def beams(self, change: Callable[[Grey], Grey]) -> "Recording":
        """Change every image of the beam, at rest and pushing."""
        return self.only_rests(change).only_frames(change)

    def only_boards(self, change: Callable[[Grey], Grey]) -> "Recording":
        """Change the images of the board."""
        return replace(self, boards=tuple(map(change, self.boards)))

    def only_rests(self, change: Callable[[Grey], Grey]) -> "Recording":
        """Change the images of the beam at rest."""
        return replace(self, rests=tuple(map(change, self.rests)))

    def only_frames(self, change: Callable[[Grey], Grey]) -> "Recording":
        """Change the images of the pushes."""
        return replace(self, frames=tuple(map(change, self.frames)))

    def in_image(self, x: float, y: float) -> Floats:
        """Project the point (x, y, 0) [m] of Sigma_a to its pixel (2,), as (u, v)."""
        return np.asarray(self.camera.project(np.array([[x, y, 0.0]]))[0])


# A perturbation takes all random numbers from the generator: equal ones give equal images.
Perturbation = Callable[[Recording, np.random.Generator], Recording]


def read_recording(observations: Path, camera: Camera) -> Recording:
    """Read the tree at `observations`, whose true camera is `camera`. Raises InputError."""
    opened = open_observations(observations)
    return Recording(
        rig=opened.rig,
        boards=tuple(opened.read_board_views()),
        rests=tuple(opened.read_rest_images()),
        frames=tuple(frame.image() for frame in opened.frames),
        camera=camera,
    )


def write_recording(recording: Recording, observations: Path, target: Path) -> None:
    """Write a recording that came from `observations` as a separate tree at `target`.

    Readings, names and order of the frames stay as they were; the number of rest images may
    differ. Raises OSError and InputError.
    """
    opened = open_observations(observations)
    target.mkdir(parents=True)
    write_text(target / "rig.json", rig_to_json(recording.rig))
    for folder, stem, images in (
        ("calibration", "view", recording.boards),
        ("rest", "rest", recording.rests),
    ):
        (target / folder).mkdir()
        for number, image in enumerate(images):
            _write(target / folder / f"{stem}_{number:03d}.png", image)
    for table in sorted(observations.glob("shard_*/metadata.csv")):
        (target / table.parent.name).mkdir()
        shutil.copy(table, target / table.parent.name)
    for frame, image in zip(opened.frames, recording.frames, strict=True):
        _write(target / frame.path.relative_to(observations), image)


def requantised(values: Floats, like: Grey) -> Grey:
    """Round values to the gray values of `like`'s type, and clip them to its range."""
    return np.clip(np.rint(values), 0, np.iinfo(like.dtype).max).astype(like.dtype)


def _write(path: Path, image: Grey) -> None:
    # Temporary: no need to wait for the disk.
    path.write_bytes(png_bytes(np.ascontiguousarray(image)))
