"""Reading of photos.json: the photographs of one beam and what is stated about them."""

import math
from pathlib import Path
from typing import Final

import numpy as np

from solver.instrument.arrays import Floats
from solver.instrument.images import ALL_CHANNELS
from solver.instrument.keys import Keys
from solver.instrument.rig import MAX_POSITION_MM, RIGIDITIES_N_MM2, SIZES_MM
from solver.instrument.rig_json import read_beam_shape
from solver.instrument.units import DEGREE, MILLIMETRE, unit_of
from solver.photographs.photo_set import (
    DOWN_SIGMA,
    KINDS,
    LENS,
    MARK_SIGMA,
    TILT_SIGMA,
    VIEW_SIGMA,
    Photograph,
    PhotoLoad,
    PhotoSet,
    Stated,
)
from solver.tracing.traced import TRACE_CHANNELS

FILE: Final = "photos.json"
# Chosen: the joint fit of 200 photographs takes minutes.
MOST_PHOTOS: Final = 200
_MOST_MARKS: Final = 100
# Marks that give a photograph without a tip a scale.
_LEAST_MARKS: Final = 2
# Chosen far beyond any image and any load; only mistakes in typing are rejected.
_PIXELS: Final = (-1e5, 1e5)
_FOCAL_PX: Final = (10.0, 1e6)
_FORCES_N: Final = (1e-12, 1e6)
_MARK_SIGMAS_PX: Final = (0.01, 100.0)
# Chosen: a shorter beam has too few pixels.
_LEAST_LENGTH_PX: Final = 50.0
# Least sine of the angle between gravity and the beam. Chosen: a load along the beam pulls or
# buckles it, and its bending does not show the force.
_LEAST_SINE: Final = 0.5


def read_photos(folder: Path) -> PhotoSet:
    """Read photos.json of a folder of photographs.

    Raises InputError with file, key, value and the allowed values, also for an unknown key.
    """
    key = Keys.read(folder / FILE)
    names = key.items("photos", 1, MOST_PHOTOS)
    length = _stated(key, "beam.length", "mm", *SIZES_MM)
    photographs = tuple(_photograph(key, name, folder, length.value) for name in names)
    files = [photograph.path for photograph in photographs]
    for name, path in zip(names, files, strict=True):
        if files.count(path) > 1:
            key.refuse(f"{name}.file", "a file that no other photo has")
    hung = any(photo.load and photo.load.kind == "weight" for photo in photographs)
    photos = PhotoSet(
        photographs=photographs,
        length=length,
        rigidity=_rigidity(key),
        shape=read_beam_shape(key),
        down=_down(key, hung),
        channel=key.one_of("channel", *TRACE_CHANNELS) if key.has("channel") else ALL_CHANNELS,
        focal=_stated(key, "camera.focal_length", "px", *_FOCAL_PX)
        if key.has("camera.focal_length_px")
        else None,
        k1=_k1(key),
        view_sigma=_angle(key, "camera.view_sigma_deg", 45, VIEW_SIGMA),
        mark_sigma=key.number("mark_sigma_px", *_MARK_SIGMAS_PX)
        if key.has("mark_sigma_px")
        else MARK_SIGMA,
        tilt_sigma=_angle(key, "clamp_tilt_sigma_deg", 45, TILT_SIGMA),
    )
    key.refuse_others()
    return photos


def _stated(key: Keys, name: str, suffix: str, low: float, high: float) -> Stated:
    """Read `name`_`suffix` and `name`_sigma_`suffix`."""
    unit = unit_of(f"{name}_{suffix}").factor
    value = key.number(f"{name}_{suffix}", low, high)
    return Stated(value * unit, key.number(f"{name}_sigma_{suffix}", 0, high) * unit)


def _angle(key: Keys, name: str, most: float, default: float) -> float:
    return key.number(name, 0, most) * DEGREE if key.has(name) else default


def _rigidity(key: Keys) -> Stated | None:
    if not key.has("beam.flexural_rigidity_n_mm2"):
        return None
    return _stated(key, "beam.flexural_rigidity", "n_mm2", *RIGIDITIES_N_MM2)


def _down(key: Keys, hung: bool) -> Stated:
    if not hung and not key.has("down_deg"):
        return Stated(-math.pi / 2, DOWN_SIGMA)
    down = key.number("down_deg", -180, 180) * DEGREE
    if hung and abs(math.sin(down)) < _LEAST_SINE - 1e-9:
        key.refuse("down_deg", "across the beam, from 30 to 150 or from -150 to -30")
    return Stated(down, _angle(key, "down_sigma_deg", 45, DOWN_SIGMA))


def _k1(key: Keys) -> Stated:
    if not (key.has("camera.k1") or key.has("camera.k1_sigma")):
        return LENS
    return Stated(key.number("camera.k1", -1, 1), key.number("camera.k1_sigma", 0, 1))


def _photograph(key: Keys, name: str, folder: Path, length: float) -> Photograph:
    clamp, tip = (key.pair(f"{name}.{end}_px", *_PIXELS) for end in ("clamp", "tip"))
    if np.hypot(*(tip - clamp)) < _LEAST_LENGTH_PX:
        key.refuse(f"{name}.tip_px", f"a point at least {_LEAST_LENGTH_PX:g} px from clamp_px")
    marks, ticks = _marks(key, f"{name}.marks"), _ticks(key, f"{name}.ticks", length)
    hidden = key.has(f"{name}.tip_hidden") and key.flag(f"{name}.tip_hidden")
    if hidden and len(marks) < _LEAST_MARKS and not len(ticks):
        key.refuse(f"{name}.tip_hidden", "false without a tick or two marks: nothing has a scale")
    principal = f"{name}.principal_point_px"
    return Photograph(
        path=folder / key.file_name(f"{name}.file"),
        clamp=clamp,
        tip=tip,
        marks=marks,
        ticks=ticks,
        tip_hidden=hidden,
        principal_point=key.pair(principal, *_PIXELS) if key.has(principal) else None,
        load=_load(key, f"{name}.load", length) if key.has(f"{name}.load") else None,
    )


def _marks(key: Keys, name: str) -> Floats:
    if not key.has(name):
        return np.zeros((0, 4))
    rows = [
        np.append(
            key.pair(f"{mark}.px", *_PIXELS),
            key.pair(f"{mark}.mm", -MAX_POSITION_MM, MAX_POSITION_MM) * MILLIMETRE,
        )
        for mark in key.items(name, 1, _MOST_MARKS)
    ]
    return np.array(rows)


def _ticks(key: Keys, name: str, length: float) -> Floats:
    if not key.has(name):
        return np.zeros((0, 4))
    rows = [
        np.append(
            key.pair(f"{tick}.px", *_PIXELS),
            _stated(key, f"{tick}.at", "mm", 0, length / MILLIMETRE),
        )
        for tick in key.items(name, 1, _MOST_MARKS)
    ]
    return np.array(rows)


def _load(key: Keys, name: str, length: float) -> PhotoLoad:
    force, place = (
        # A value needs its sigma, and a sigma its value.
        key.has(f"{name}.{value}_{unit}") or key.has(f"{name}.{value}_sigma_{unit}")
        for value, unit in (("force", "n"), ("at", "mm"))
    )
    return PhotoLoad(
        kind=key.one_of(f"{name}.kind", *KINDS),
        force=_stated(key, f"{name}.force", "n", *_FORCES_N) if force else None,
        place=_stated(key, f"{name}.at", "mm", 0, length / MILLIMETRE) if place else None,
    )
