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
