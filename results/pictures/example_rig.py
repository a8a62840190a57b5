"""The example rig of the antenna's software, rendered; its truth is kept apart."""

import csv
import io
import json
import shutil
from itertools import cycle, groupby
from pathlib import Path
from typing import Any, Final, NamedTuple

import cv2

from solver.instrument.errors import InputError
from solver.instrument.files import write_text
from solver.instrument.image_frame import ImageFrame
from solver.instrument.images import read_grey
from solver.instrument.units import DEGREE
from solver.lab.example import VIDEO
from vbaa_bench.api.data import Dataset, generate
from vbaa_bench.scene.load import load_scene

FRAMES_PER_SECOND: Final = 4
QUALITY: Final = 95  # of Motion JPEG. Chosen: a third of the bytes of the images


class TrueFrame(NamedTuple):
    """A frame, its push and step from 0, and its contact distance [mm] and force [N]."""

    frame: ImageFrame
    push: int
    step: int
    x_c_mm: float
    force_n: float

    @property
    def values(self) -> dict[str, float]:
        """Truth by the names of columns."""
        return {"x_c_mm": round(self.x_c_mm, 4), "force_n": round(self.force_n, 6)}


def example_rig(scene: Path, work: Path, out: Path, truth: Path, variant: str) -> None:
    """Render the scene's rig into the new folder `out`, and write `truth` (JSON).

    The dataset is in the folder `work`, and is kept there. The video shows the same pushes, each
    after an image at rest. `truth` has the true values of every image, by its frame_id. Raises
    InputError.
    """
    if out.exists():
        raise InputError(f"{out}: exists already")
    data = generate(load_scene(scene), work, variant=variant, progress=True)
    source, frames = data.observations.root, _frames(data)
    for folder in ("calibration", "rest"):
        shutil.copytree(source / folder, out / folder)
    shutil.copyfile(source / "rig.json", out / "rig.json")
    truths = _write_images(frames, out / "images")
    write_text(truth, json.dumps(truths, indent=1) + "\n")
    rest = cycle(data.observations.rest_images)
    pushes = groupby(frames, lambda one: one.push)
    film = [path for _, push in pushes for path in (next(rest), *(one.frame.path for one in push))]
    _write_video(film, out / VIDEO)


def _frames(data: Dataset) -> list[TrueFrame]:
    """Join frames and truth, in the order of pushes and steps."""
    by_id = {frame.frame_id: frame for frame in data.observations.frames}
    pushes = data.truth.frames.sort("trial").partition_by("push_id", maintain_order=True)
    return [
        TrueFrame(by_id[row["frame_id"]], number, row["step"], row["x_c_mm"], row["force_n"])
        for number, push in enumerate(pushes)
        for row in push.iter_rows(named=True)
    ]


def _write_images(frames: list[TrueFrame], folder: Path) -> dict[str, Any]:
    """Copy the frames under names that show push and step, with a table; return their truth."""
    folder.mkdir()
    table, truths = io.StringIO(newline=""), {}
    writer = csv.writer(table, lineterminator="\n")
    writer.writerow(["file_name", "frame_id", "motor_angle_deg", "push_id", "step"])
    for one in frames:
        name, angle = f"push_{one.push + 1}_{one.step + 1}", one.frame.readings.motor_angle
        shutil.copyfile(one.frame.path, folder / f"{name}.png")
        degrees = "" if angle is None else f"{angle / DEGREE:.4f}"
        writer.writerow([f"{name}.png", name, degrees, one.push + 1, one.step])
        truths[name] = one.values
    write_text(folder / "metadata.csv", table.getvalue())
    return truths


def _write_video(images: list[Path], path: Path) -> None:
    """Write gray images as Motion JPEG."""
    pictures = [read_grey(image) for image in images]
    height, width = pictures[0].shape
    writer = cv2.VideoWriter(
        str(path),
        cv2.CAP_OPENCV_MJPEG,
        cv2.VideoWriter.fourcc(*"MJPG"),
        FRAMES_PER_SECOND,
        (width, height),
    )
    writer.set(cv2.VIDEOWRITER_PROP_QUALITY, QUALITY)
    for picture in pictures:
        writer.write(cv2.cvtColor(picture, cv2.COLOR_GRAY2BGR))
    writer.release()
