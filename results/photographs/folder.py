"""Folders of photographs: what a laboratory would have, and the truth in another tree.

WORK/
  rigs/rig_0000/photos.json, rest_0.jpg, load_0.jpg, ...
  truth/rig_0000.json
"""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import numpy as np

from results.photographs.draw import (
    FORCE_SIGMA,
    PLACE_SIGMA_MM,
    Load,
    RigDraw,
    draw_rig,
)
from results.photographs.picture import Shot, rendered
from solver.instrument.arrays import Floats
from solver.instrument.units import MILLIMETRE
from solver.lab.writing import write
from vbaa_bench.mechanics.state import EquilibriumError

STATED: Final = "photos.json"
# A rig is drawn again if one of its loads is impossible. Chosen: none was in hundreds.
_ATTEMPTS: Final = 20


def rig_name(number: int) -> str:
    """Return the name of a rig's folder."""
    return f"rig_{number:04d}"


def possible_rig(seed: int, number: int) -> RigDraw:
    """Draw a rig whose loads have an equilibrium."""
    for attempt in range(_ATTEMPTS):
        rig = draw_rig(seed + 1_000_003 * attempt, number)
        try:
            for photo in rig.photos:
                _ = Shot(rig, photo).pose
        except EquilibriumError:
            continue
        return rig
    raise ValueError(f"rig {number} of seed {seed} has no equilibrium in {_ATTEMPTS} draws")


def write_rig(
    seed: int, number: int, work: Path, progress: Callable[[], None] = lambda: None
) -> None:
    """Draw and photograph one rig into `work`; what is there already is kept.

    photos.json is written last: a folder that has it is complete. `progress` is called after every
    photograph. Raises InputError if a file cannot be written.
    """
    rig = possible_rig(seed, number)
    folder, names = work / "rigs" / rig_name(number), file_names(rig)
    if (folder / STATED).exists():
        for _ in names:
            progress()
        return
    random = np.random.default_rng([seed, number, 1])
    stated, truths = [], []
    for number_in_rig, (name, photo) in enumerate(zip(names, rig.photos, strict=True)):
        shot = Shot(rig, photo)
        if not (folder / name).exists():
            write(folder / name, rendered(shot, number_in_rig))
        stated.append(_stated(name, shot, random))
        truths.append(_truth(name, shot))
        progress()
    truth = json.dumps({"rig": rig.truth, "photos": truths}, indent=1)
    write(work / "truth" / f"{rig_name(number)}.json", truth.encode())
    document = {**rig.stated, "photos": stated}
    write(folder / STATED, (json.dumps(document, indent=1) + "\n").encode())


def file_names(rig: RigDraw) -> list[str]:
    """Name the files of a rig's photographs."""
    rest = sum(photo.load is None for photo in rig.photos)
    return [
        *(f"rest_{i}.jpg" for i in range(rest)),
        *(f"load_{i}.jpg" for i in range(len(rig.photos) - rest)),
    ]


def _stated(name: str, shot: Shot, random: np.random.Generator) -> dict[str, Any]:
    """Return the keys of one photograph in photos.json: marks are clicked on with an error."""
    rig, load = shot.rig, shot.photo.load
    sigma = rig.stated["mark_sigma_px"]

    def clicked(pixel: Floats) -> list[float]:
        return [round(float(v), 2) for v in pixel + sigma * random.standard_normal(2)]

    keys: dict[str, Any] = {
        "file": name,
        "clamp_px": clicked(shot.centreline_px[0]),
        "tip_px": clicked(shot.centreline_px[-1]),
    }
    if rig.marks_mm:
        places = np.column_stack([np.array(rig.marks_mm), np.zeros(len(rig.marks_mm))])
        pixels = shot.camera.project(places * MILLIMETRE)
        keys["marks"] = [
            {"px": clicked(pixel), "mm": list(place)}
            for pixel, place in zip(pixels, rig.marks_mm, strict=True)
        ]
    if load is not None:
        keys["load"] = {"kind": "weight", **_known(load, random)}
    return keys


def _known(load: Load, random: np.random.Generator) -> dict[str, float]:
    if not load.known:
        return {}
    sigma = FORCE_SIGMA * load.force_n
    return {
        "force_n": load.force_n + sigma * float(random.standard_normal()),
        "force_sigma_n": sigma,
        "at_mm": load.at_mm + PLACE_SIGMA_MM * float(random.standard_normal()),
        "at_sigma_mm": PLACE_SIGMA_MM,
    }


def _truth(name: str, shot: Shot) -> dict[str, Any]:
    load, state = shot.photo.load, shot.pose.state
    return {
        "file": name,
        "clamp_tilt_deg": shot.photo.tilt_deg,
        "camera": shot.photo.camera,
        "tip_deflection_mm": float(np.linalg.norm(state.tip[1:])) / MILLIMETRE,
        "force_n": None if load is None else load.force_n,
        "s_c_mm": None if load is None else load.at_mm,
        "known": load is not None and load.known,
        "centreline_px": shot.centreline_px.round(3).tolist(),
    }
