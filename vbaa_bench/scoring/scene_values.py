"""Values of a scene for each of its frames."""

from typing import Any

import polars as pl

from vbaa_bench.dataset.readers import Truth


def scene_value(truth: Truth, key: str, default: Any = None) -> pl.Expr:
    """Return an expression of a scene's value for each frame, by its key, such as object.friction.

    A value that was drawn for pushes or frames is a column of the truth; where another kind of
    object was drawn, which does not have the key, it is null. `default` is for scenes without the
    key.
    """
    if f"drawn.{key}" in truth.frames.columns:
        return pl.col(f"drawn.{key}")
    value: Any = truth.manifest["scene"]
    for part in key.split("."):
        value = value.get(part) if isinstance(value, dict) else None
    return pl.lit(default if value is None else value)


def first_light(truth: Truth) -> str:
    """Return the kind of a scene's first light, as the scene states it."""
    lights = truth.manifest["scene"].get("lights") or [{}]
    return str(lights[0].get("kind", "area above"))


def object_radius(truth: Truth) -> pl.Expr:
    """Return an expression of the radius [mm] of each frame's object: 0 of an edge, null of none.

    An object of any other shape, such as a mesh or a wall, has none.
    """
    sharp = scene_value(truth, "object.kind", "block").is_in(["block", "knife_edge"])
    names = ("radius_mm", "nose_radius_mm", "face_radius_mm")
    radii = [scene_value(truth, f"object.{name}").cast(pl.Float64) for name in names]
    return pl.when(sharp).then(0.0).otherwise(pl.coalesce(radii))
