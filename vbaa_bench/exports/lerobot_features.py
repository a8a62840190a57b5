"""Features of a LeRobot dataset: image, state, action and labels, with their columns."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import polars as pl

from vbaa_bench.exports.columns import VECTORS, Schema
from vbaa_bench.exports.parquet import TYPE_NAMES
from vbaa_bench.exports.source import Source

IMAGE: Final = "observation.image"
STATE: Final = "observation.state"
ACTION: Final = "action"
# Readings that are no state: an interval of the image to leave out, which may be null.
_INTERVAL: Final = ("removed_from_mm", "removed_to_mm")
_ENCODER: Final = "motor_angle_deg"
# Features that every LeRobot dataset has.
USUAL: Final = {
    "timestamp": pl.Float32(),
    "frame_index": pl.Int64(),
    "episode_index": pl.Int64(),
    "index": pl.Int64(),
    "task_index": pl.Int64(),
}


class Feature(NamedTuple):
    """A feature: its columns of the table, and the type of its values.

    A feature of several columns, and one of a vector, has `size` values; others one.
    """

    columns: tuple[str, ...]
    dtype: pl.DataType
    size: int = 1


@dataclass(frozen=True)
class Features:
    """All features except the image and the usual ones, by name, and the size of the images."""

    by_name: Mapping[str, Feature]
    width_px: int
    height_px: int

    def table(self, table: pl.DataFrame) -> pl.DataFrame:
        """Make the columns of the features: a missing number is NaN, a missing text is empty."""
        return table.select(
            _expression(feature).alias(name) for name, feature in self.by_name.items()
        )

    def info(self) -> dict[str, Any]:
        """Describe all features for meta/info.json."""
        image = {
            "dtype": "image",
            "shape": [self.height_px, self.width_px, 3],
            "names": ["height", "width", "channels"],
        }
        described = {name: _described(feature) for name, feature in self.by_name.items()}
        usual = {
            name: {"dtype": TYPE_NAMES[dtype], "shape": [1], "names": None}
            for name, dtype in USUAL.items()
        }
        return {IMAGE: image, **described, **usual}


def _expression(feature: Feature) -> pl.Expr:
    (first, *others), missing = feature.columns, pl.lit(float("nan"))
    if feature.dtype == pl.String():
        return pl.col(first).fill_null("")
    if others or (feature.size > 1 and first not in VECTORS):
        return pl.concat_list(feature.columns).cast(pl.List(feature.dtype))
    if feature.size > 1:
        return pl.col(first).fill_null(pl.concat_list([missing] * feature.size))
    filled = pl.col(first).fill_null(missing) if feature.dtype.is_float() else pl.col(first)
    return filled.cast(feature.dtype)


def _described(feature: Feature) -> dict[str, Any]:
    names = list("xyz") if feature.columns[0] in VECTORS else list(feature.columns)
    text = feature.dtype == pl.String()
    return {
        "dtype": TYPE_NAMES[feature.dtype],
        "shape": [feature.size],
        "names": None if text else names,
    }


def lerobot_features(source: Source) -> Features:
    """Choose the features of a source whose rigs have images of one size.

    The state has all readings, the action is the motor angle: the encoder's or, if the camera is
    fixed in the world and there is no encoder, the true one. Lists of varying length are left out.
    """
    rigs = list(source.rigs.values())
    schema, fixed = source.schema, any(rig.stated("camera.mount") == "world" for rig in rigs)
    without = {*_INTERVAL, _ENCODER} if fixed else {*_INTERVAL}
    state = tuple(name for name in schema.readings if name not in without)
    angle = "true_motor_angle_deg" if fixed else _ENCODER
    features = {ACTION: Feature((angle,), pl.Float32())}
    if state:
        features[STATE] = Feature(state, pl.Float32(), len(state))
    names = ["rig", "frame_id", "split", "push_id", "step"]
    features |= {name: _single(schema, name) for name in names}
    readings = [name for name in _INTERVAL if name in schema.types]
    features |= {f"reading.{name}": _single(schema, name) for name in readings}
    labels = [
        name
        for name in schema.labels
        if name in VECTORS or not isinstance(schema.types[name], pl.List)
    ]
    features |= {f"truth.{name}": _single(schema, name) for name in labels}
    return Features(features, rigs[0].camera.width, rigs[0].camera.height)


def _single(schema: Schema, name: str) -> Feature:
    if name in VECTORS:
        return Feature((name,), pl.Float64(), 3)
    # Whole numbers of the truth may be null, as the contact's row, which NaN stands for.
    dtype = schema.types[name]
    return Feature((name,), pl.Float64() if dtype == pl.Int64() and name != "step" else dtype)
