"""The information limit of x_c beside the scores, for the information that each method uses."""

from typing import Final

import polars as pl

# What a method obtains from a frame, as in `dataset.derived`. A method of a user may use all of
# "planar"; its efficiency is then a lower limit.
_USES: Final = {
    "three_point": ("image",),
    "exact_fit_3d": ("moment", "image"),
    "moment_sensor": ("moment", "image"),
    "force_sensor": ("force", "image"),
    "stiffness": ("push", "planar"),
    "push_fit": ("push", "planar"),
    "push_fit_friction": ("push", "planar"),
}
_USES_PLANAR: Final = ("planar", "image")
WORDS: Final = {
    "planar": "the image",
    "image": "the image, psi unknown",
    "moment": "image and moment sensor",
    "force": "image and force sensor",
    "push": "the push",
}


def with_limits(scores: pl.DataFrame, limits: pl.DataFrame | None) -> pl.DataFrame:
    """Add the columns `information` and `x_c_limit_pct_L` to scores; null where there is no limit.

    `limits` has the columns of `dataset.derived.read_limits`, and `length_mm`, the beam's length;
    in a collection also `rig`.
    """
    if limits is None or limits.is_empty():
        nothing = {"information": pl.String, "x_c_limit_pct_L": pl.Float64}
        return scores.with_columns(pl.lit(None, kind).alias(name) for name, kind in nothing.items())
    present = set(limits["information"])
    used = {
        name: next(
            (one for one in _USES.get(name.partition("@")[0], _USES_PLANAR) if one in present), None
        )
        for name in scores["method"].unique()
    }
    keys = [name for name in ("rig", "frame_id") if name in limits.columns]
    bounds = limits.select(
        *keys,
        "information",
        (100 * pl.col("x_c_limit_mm") / pl.col("length_mm")).alias("x_c_limit_pct_L"),
    )
    return scores.with_columns(
        information=pl.col("method").replace_strict(used, return_dtype=pl.String)
    ).join(bounds, on=[*keys, "information"], how="left", maintain_order="left")
