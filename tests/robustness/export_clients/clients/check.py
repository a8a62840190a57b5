"""Checks of what a client has loaded: counts, names, pixels, readings and labels."""

import hashlib
import math
from collections import Counter
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

# Frames of the dataset by name. A row has `columns`, the readings and labels by name; `pixels`,
# the pixel_digest of the image; its `dtype`; and some columns under their own names.
Rows = dict[str, dict[str, Any]]


class Check(NamedTuple):
    """One check: what is asked, and what is expected and measured, as texts."""

    asked: str
    expected: str
    measured: str
    right: bool


def check(asked: str, expected: Any, measured: Any) -> Check:
    """Compare two values; sets and lists are shown by their sizes."""
    return Check(asked, _short(expected), _short(measured), bool(expected == measured))


def _short(value: Any) -> str:
    if isinstance(value, dict):
        return ", ".join(f"{name} {count}" for name, count in sorted(value.items()))
    return str(len(value)) if isinstance(value, set | list) else str(value)


def by_split(rows: Rows) -> dict[str, int]:
    """Count the frames of each split."""
    return dict(Counter(row["split"] for row in rows.values()))


def frame_key(rows: Rows, row: dict[str, Any]) -> str:
    """Return the name of a frame, with the rig's in a collection."""
    name = decoded(row["frame_id"])
    return name if name in rows else f"{decoded(row['rig'])}_{name}"


def decoded(value: Any) -> Any:
    """Decode bytes, which some libraries have for texts; return other values as they are."""
    return value.decode() if isinstance(value, bytes) else value


def pixels(rows: Rows, images: dict[str, Any]) -> Iterator[Check]:
    """Compare the sha256 of decoded pixels, in the dataset's type, and the type itself."""
    equal = sum(
        pixel_digest(images[key]) == row["pixels"] for key, row in rows.items() if key in images
    )
    yield check("images with equal pixels", len(rows), equal)
    types = {image.dtype.name for image in images.values()}
    expected = {row["dtype"] for row in rows.values()}
    yield check("types of pixels", ", ".join(sorted(expected)), ", ".join(sorted(types)))


def pixel_digest(image: Any) -> str:
    """Compute the sha256 of an image's pixels, in little-endian order."""
    values = np.ascontiguousarray(image)
    return hashlib.sha256(values.astype(values.dtype.newbyteorder("<")).tobytes()).hexdigest()


def labels(rows: Rows, loaded_rows: dict[str, dict[str, Any]], precision: Any = float) -> Check:
    """Compare every column that both have; a number in the precision of the client."""
    compared = equal = 0
    for key, row in rows.items():
        for name in row["columns"].keys() & loaded_rows.get(key, {}).keys():
            compared += 1
            equal += _same(row["columns"][name], loaded_rows[key][name], precision)
    right = compared == equal and compared >= 20 * len(rows)
    return check("equal readings and labels", compared, equal)._replace(right=right)


def _same(expected: Any, value: Any, precision: Any) -> bool:
    if isinstance(expected, list):
        return len(expected) == len(value) and all(
            _same(one, two, precision) for one, two in zip(expected, value, strict=True)
        )
    if expected is None:
        empty = value is None or value == "" or (isinstance(value, float) and math.isnan(value))
        nothing = isinstance(value, list) and all(map(math.isnan, value))
        return bool(empty or nothing)
    if isinstance(expected, str | bool):
        return bool(value == expected)
    return bool(precision(value) == precision(expected))
