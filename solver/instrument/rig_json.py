"""Reading and writing of rig.json: the nominal rig with its tolerances, units in the keys."""

import json
from collections import defaultdict
from collections.abc import Collection, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from solver.instrument.beam import Beam
from solver.instrument.beam_shape import CLAMP_SHIFT, SOFTNESS, BeamShape, stated_shape
from solver.instrument.board import Board
from solver.instrument.errors import InputError
from solver.instrument.keys import Keys
from solver.instrument.rig import ANY_LIGHT, ClampOffset, Gravity, Light, Rig, Sensors, Tolerances
from solver.instrument.rig_keys import (
    BOARDS,
    KEYS,
    PROJECTIONS,
    TIP_SIGMA_RADII,
    Key,
    length_mm,
)
from solver.instrument.transforms import rigid, rotation_vector
from solver.instrument.units import MILLIMETRE, unit_of

# Name in messages of a document that was never a file.
_WRITTEN: Final = Path("rig.json")


def rig_to_json(rig: Rig) -> str:
    """Format a rig as the text of rig.json; the same rig gives the same bytes."""
    parts, document = _parts_of(rig), defaultdict[str, dict[str, Any]](dict)
    for key in KEYS:
        part, attribute = key.place.split(".")
        value = parts[part].get(attribute)
        if key.is_written(value):
            section, name = key.name.split(".")
            document[section][name] = _in_unit(value, unit_of(key.name).factor)
    return json.dumps(document, indent=2) + "\n"


def _in_unit(value: Any, factor: float) -> Any:
    """Convert a value or an array from SI units to those of a key."""
    if isinstance(value, np.ndarray | list):
        return [_in_unit(item, factor) for item in value]
    value = value if factor == 1 else value / factor
    # Twelve digits: a nanometre on a kilometre, without the rounding errors of unit conversion.
    return float(f"{value:.12g}") + 0.0 if isinstance(value, float) else value


def _parts_of(rig: Rig) -> dict[str, dict[str, Any]]:
    """Return the attributes of the parts of a rig by place, without those that are not written."""
    shape, length = rig.shape, rig.beam.length
    light = vars(rig.light)
    if (rig.light.slope, rig.light.slope_sigma) == (0.0, ANY_LIGHT):
        light = light | {"slope": None, "slope_sigma": None}
    stated = {
        "taper": shape.taper_sigma,
        "softness": shape.sigma(SOFTNESS),
        "clamp_shift": shape.sigma(CLAMP_SHIFT) * length,
    }
    return {
        "rig": vars(rig) | {"telecentric": PROJECTIONS[rig.telecentric]},
        "beam": vars(rig.beam),
        "tolerances": vars(rig.tolerances),
        "clamp_offset": {} if rig.clamp_offset.none else vars(rig.clamp_offset),
        "board": vars(rig.board) | {"kind": rig.board.kind},
        "pose": {
            "translation": rig.antenna_from_board[:3, 3],
            "rotation_vector": rotation_vector(rig.antenna_from_board),
        },
        "light": light,
        "sensors": vars(rig.sensors),
        "shape": vars(shape) | {"bow_sigma": shape.bow_sigma * length},
        "stated": {} if shape.is_learned else stated,
        "learned": vars(shape) if shape.is_learned else {},
        "gravity": {} if rig.gravity is None else vars(rig.gravity),
    }


def read_rig(path: Path) -> Rig:
    """Read a `rig.json`. Raises InputError with file, key, value and the allowed values.

    An unknown key is an error too: a misspelt one would silently be a tolerance left out.
    """
    return _rig_of(Keys.read(path))


def sigma_keys(rig: Rig) -> tuple[str, ...]:
    """Return the keys of rig.json that state, or could state, an error of the rig.

    Errors of readings are not among them.
    """
    document = json.loads(rig_to_json(rig))
    keys = Keys(_WRITTEN, document)

    def states_error(key: Key) -> bool:
        section, name = key.name.split(".")
        is_stated = name in document.get(section, {})
        return "sigma" in name or ("covariance" in name and is_stated)

    of_rig = (key for key in KEYS if not key.name.partition(".")[0].endswith("sensor"))
    return tuple(key.name for key in of_rig if states_error(key) and key.case.holds(keys))


def without_errors(rig: Rig, keys: Collection[str]) -> Rig:
    """Return the rig with a file's `keys`, which are those of `sigma_keys`, at zero."""
    document = defaultdict(dict, json.loads(rig_to_json(rig)))
    for key in keys:
        section, name = key.split(".")
        document[section][name] = np.zeros_like(document[section].get(name, 0.0)).tolist()
    return _rig_of(Keys(_WRITTEN, dict(document)))


def _rig_of(keys: Keys) -> Rig:
    parts = _read_parts(keys)
    beam, offset = Beam(**parts["beam"]), parts["clamp_offset"]
    parts["tolerances"].setdefault("tip", TIP_SIGMA_RADII * beam.radius)
    if "sigma" in offset:
        offset["covariance"] = np.eye(2) * offset.pop("sigma") ** 2
    rig = Rig(
        **parts["rig"],
        beam=beam,
        tolerances=Tolerances(**parts["tolerances"]),
        clamp_offset=ClampOffset(**offset),
        board=_board(keys, **parts["board"]),
        antenna_from_board=rigid(**parts["pose"]),
        light=Light(**parts["light"]),
        sensors=Sensors(**parts["sensors"]),
        shape=_beam_shape(parts, beam.length),
        gravity=Gravity(**parts["gravity"]) if parts["gravity"] else None,
    )
    if rig.telecentric and rig.distortion_coefficients:
        raise InputError(
            f"{keys.path}: camera.distortion_coefficients is {rig.distortion_coefficients}, a "
            "telecentric camera has none"
        )
    if not rig.clamp_offset.none and keys.has("camera.mount"):
        # A camera that is fixed in the world shows where the clamp is at every motor angle.
        keys.one_of("camera.mount", "antenna")
    keys.refuse_others()
    return rig


def read_beam_shape(keys: Keys) -> BeamShape:
    """Read the section `beam_shape` of a document that has the key `beam.length_mm`.

    By default the beam is drawn wire. Raises InputError.
    """
    return _beam_shape(_read_parts(keys, "beam_shape."), length_mm(keys) * MILLIMETRE)


def _read_parts(keys: Keys, section: str = "") -> defaultdict[str, dict[str, Any]]:
    """Read the keys that begin with `section`, as attributes by part."""
    parts = defaultdict[str, dict[str, Any]](dict)
    for key in KEYS:
        if key.name.startswith(section) and key.case.holds(keys):
            part, attribute = key.place.split(".")
            value = key.read(keys)
            if value is not None:
                parts[part][attribute] = value
    return parts


def _board(keys: Keys, kind: str, **attributes: Any) -> Board:
    try:
        return BOARDS[kind](**attributes)
    except ValueError as error:
        raise InputError(f"{keys.path}: board: {error}") from error


def _beam_shape(parts: Mapping[str, dict[str, Any]], length: float) -> BeamShape:
    """Make the shape of a beam of this length [m]."""
    shape, stated, learned = parts["shape"], parts["stated"], parts["learned"]
    shape["bow_sigma"] /= length
    if learned:
        return BeamShape(**shape, **learned)
    stated["clamp_shift"] /= length
    section, friction = shape["section_sigma"], shape["friction_sigma"]
    return replace(stated_shape(**stated, section=section, friction=friction), **shape)
