"""A set of images with known loads, written as a laboratory would."""

import csv
import math
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np

from solver.instrument.images import png_bytes, read_grey
from solver.instrument.observation import Observations
from solver.instrument.rig import Gravity
from solver.instrument.rig_json import rig_to_json
from solver.lab.protocol import KNOWN, MIN_LOADS

COLUMNS = ("file_name", "load", "distance_mm", "distance_sigma_mm", "mass_g", "mass_sigma_g")
# Gravity points to the side to which contact bends the beam.
DOWN = Gravity(math.pi / 2, math.radians(0.5))


def write_known(folder: Path, rows: list[list[str]]) -> None:
    with (folder / KNOWN).open("w", encoding="utf-8", newline="") as stream:
        csv.writer(stream).writerows([COLUMNS, *rows])


def write_complete_set(observations: Observations, folder: Path) -> Path:
    """Write a complete set, whose images show other loads than its table states."""
    rig = replace(observations.rig, gravity=DOWN)
    folder.mkdir()
    (folder / "rig.json").write_text(rig_to_json(rig), encoding="utf-8")
    _copy(observations.board_views, folder / "calibration", "view")
    for name in ("rest", "ruler"):
        _copy(observations.rest_images, folder / name, name)
    (folder / "ground").mkdir()
    for number, path in enumerate(observations.rest_images):
        ground = np.full_like(read_grey(path), 10)
        ground[0, number] = 11
        (folder / "ground" / f"ground_{number:02d}.png").write_bytes(png_bytes(ground))
    (folder / "images").mkdir()
    image = read_grey(observations.frames[0].path)
    rows = []
    for number in range(2 * MIN_LOADS):
        name = f"load_{number:02d}.png"
        distinct = image.copy()
        distinct[0, number] ^= 1
        (folder / "images" / name).write_bytes(png_bytes(distinct))
        distance = str(80 + 20 * (number % 5))
        weight = ["4.25", "0.02"] if number < MIN_LOADS else ["", ""]
        rows.append([name, "weight" if weight[0] else "push", distance, "0.5", *weight])
    write_known(folder, rows)
    return folder


def _copy(images: tuple[Path, ...], folder: Path, name: str) -> None:
    folder.mkdir()
    for number, image in enumerate(images):
        shutil.copy(image, folder / f"{name}_{number:02d}.png")
