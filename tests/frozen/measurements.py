"""Measurements of frames as plain arrays, which no change of a class makes unreadable."""

import json
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from solver.instrument.arrays import Floats
from solver.instrument.measurement import Measurement, RestBow, Tip, View
from solver.instrument.rig import Rig
from solver.instrument.rig_json import read_rig

_NONE: Final = np.nan
# Unit of stored places, over the beam's length.
_UNIT: Final = 1e-9


class Frame(NamedTuple):
    """A frame: its name, its dataset's and its push's; its true x_c [m], None without contact; what
    is measured, without the frames before it, and the numbers of these in the list of all frames.
    """

    name: str
    dataset: str
    push: str
    x_c: float | None
    measurement: Measurement
    earlier: tuple[int, ...]


def save(folder: Path, frames: Sequence[Frame], rigs: dict[str, str]) -> None:
    """Write frames, and the text of each dataset's rig.json, into a folder."""
    arrays: dict[str, Any] = {
        key: np.stack([_fixed(frame.measurement)[key] for frame in frames])
        for key in _fixed(frames[0].measurement)
    }
    rows = [_rows(frame.measurement) for frame in frames]
    arrays["counts"] = np.array([one.places.shape[0] for one in rows])
    arrays["columns"] = np.array([one.errors.shape[1] for one in rows])
    arrays["scales"] = np.array([one.scale for one in rows])
    arrays["places"] = np.concatenate([one.places for one in rows])
    arrays["errors"] = np.concatenate([one.errors.ravel() for one in rows])
    np.savez_compressed(folder / "measurements.npz", **arrays)
    names = [[one.name, one.dataset, one.push, one.x_c, one.earlier] for one in frames]
    text = json.dumps({"frames": names, "rigs": {key: json.loads(rigs[key]) for key in rigs}})
    (folder / "frames.json").write_text(text, "utf-8")


def load(folder: Path) -> list[Frame]:
    """Read all frames of a folder."""
    stated = json.loads((folder / "frames.json").read_text("utf-8"))
    rigs = {name: _rig(values) for name, values in stated["rigs"].items()}
    with np.load(folder / "measurements.npz") as arrays:
        fixed = {key: arrays[key] for key in arrays.files}
    counts, columns, scales = (fixed.pop(key) for key in ("counts", "columns", "scales"))
    places = np.split(fixed.pop("places"), np.cumsum(counts)[:-1])
    errors = np.split(fixed.pop("errors"), np.cumsum(counts * columns)[:-1])
    frames = []
    for i, (name, dataset, push, x_c, earlier) in enumerate(stated["frames"]):
        one = {key: values[i] for key, values in fixed.items()}
        rows = _Rows(places[i], errors[i].reshape(counts[i], columns[i]), scales[i])
        measured = _measurement(one, rows, rigs[dataset])
        frames.append(Frame(name, dataset, push, x_c, measured, tuple(earlier)))
    return frames


def whole(frames: Sequence[Frame]) -> Iterator[Measurement]:
    """Yield what a tracker gives to a method: the measurement with those before it."""
    for frame in frames:
        earlier = tuple(frames[i].measurement for i in frame.earlier)
        yield replace(frame.measurement, earlier=earlier)


def _rig(values: dict[str, Any]) -> Rig:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "rig.json"
        path.write_text(json.dumps(values), "utf-8")
        return read_rig(path)


def _fixed(one: Measurement) -> dict[str, Floats]:
    bow, tip = one.rest_bow, one.view.tip
    assert bow is not None, "a measurement from an image has a bow, which may be 0"
    values = {
        "base_covariance": one.base_covariance,
        "scale_sigma": one.scale_sigma,
        "motor_angle": _NONE if one.motor_angle is None else one.motor_angle,
        "antenna_from_beam": one.antenna_from_beam,
        "moment_y": _NONE if one.moment_y is None else one.moment_y,
        "base_force": 3 * [_NONE] if one.base_force is None else one.base_force,
        "base_moment": 3 * [_NONE] if one.base_moment is None else one.base_moment,
        "viewpoint": one.view.viewpoint,
        "viewpoint_known": one.viewpoint_known,
        "tip_point": 2 * [_NONE] if tip is None else tip.point,
        "tip_covariance": np.full((2, 2), _NONE) if tip is None else tip.covariance,
        "tip_sigma": _NONE if one.tip_sigma is None else one.tip_sigma,
        "image_shift": one.image_shift,
        "axis_sigma": one.axis_sigma,
        "bow": bow.coefficients,
        "bow_by_weight": bow.by_weight,
        "bow_covariance": bow.covariance,
        "line_covariance": bow.line_covariance,
        "bow_scale_sigma": bow.scale_sigma,
        "bow_errors": bow.errors,
    }
    return {key: np.asarray(value, dtype=float) for key, value in values.items()}


class _Rows(NamedTuple):
    """What each point of a frame has, in few bytes.

    `places` (n, 4) are point and removed bow in 10^-9 of the beam's length, a thousandth of a
    sigma, as differences from the point before. `errors` (n, 2 + k) are sigma vector, over `scale`
    [m], and shared errors, in half precision.
    """

    places: npt.NDArray[np.int32]
    errors: npt.NDArray[np.float16]
    scale: float


def _rows(one: Measurement) -> _Rows:
    assert one.rest_bow is not None
    view, unit = one.view, _UNIT * one.rig.beam.length
    places = np.rint(np.hstack([view.points, one.rest_bow.removed]) / unit)
    scale = float(np.abs(view.sigma_vectors).max(initial=0.0)) or 1.0
    errors = np.hstack([view.sigma_vectors / scale, view.shared_errors])
    differences = np.diff(places, axis=0, prepend=np.zeros((1, 4)))
    return _Rows(differences.astype(np.int32), errors.astype(np.float16), scale)


def _measurement(one: dict[str, Floats], rows: _Rows, rig: Rig) -> Measurement:
    places = np.cumsum(rows.places.astype(float), axis=0) * (_UNIT * rig.beam.length)
    points, removed = places[:, :2], places[:, 2:]
    sigmas, shared = np.split(rows.errors.astype(float), [2], axis=1)
    sigmas = sigmas * rows.scale
    tip = None
    if np.isfinite(one["tip_point"]).all():
        tip = Tip(one["tip_point"], one["tip_covariance"])
    return Measurement(
        view=View(points, sigmas, one["viewpoint"], tip, shared),
        base_covariance=one["base_covariance"],
        scale_sigma=float(one["scale_sigma"]),
        motor_angle=_optional(one["motor_angle"]),
        rig=rig,
        antenna_from_beam=one["antenna_from_beam"],
        moment_y=_optional(one["moment_y"]),
        base_force=_vector(one["base_force"]),
        base_moment=_vector(one["base_moment"]),
        viewpoint_known=bool(one["viewpoint_known"]),
        tip_sigma=_optional(one["tip_sigma"]),
        image_shift=one["image_shift"],
        axis_sigma=float(one["axis_sigma"]),
        rest_bow=RestBow(
            coefficients=one["bow"],
            covariance=one["bow_covariance"],
            line_covariance=one["line_covariance"],
            removed=removed,
            scale_sigma=float(one["bow_scale_sigma"]),
            errors=int(one["bow_errors"]),
            by_weight=one["bow_by_weight"],
        ),
    )


def _optional(value: Floats) -> float | None:
    return float(value) if np.isfinite(value) else None


def _vector(values: Floats) -> tuple[float, float, float] | None:
    if not np.isfinite(values).all():
        return None
    x, y, z = values.tolist()
    return x, y, z
