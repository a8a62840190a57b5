"""Information sets: what each method may use, and so the limit with which it is compared."""

from typing import Any, Final

import polars as pl

from solver.instrument.errors import InputError
from vbaa_bench.dataset.derived import LIMITS, read_limits
from vbaa_bench.dataset.document import LARGEST
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.dataset.tables import checked
from vbaa_bench.scoring.score_columns import LIMIT_SCHEMA
from vbaa_bench.scoring.scored_quantities import LIMITED

# The set of each method of the solver. Others use "image", unless they declare another one.
_OF_METHOD: Final = {
    "two_point": "planar",
    "three_point": "image",
    "moment_sensor": "moment",
    "stiffness": "push",
    "linear_fit": "planar",
    "exact_fit": "planar",
    "exact_fit_3d": "image",
    "exact_fit_learned": "learned",
    "two_contact_fit": "planar",
    "hung_weight": "planar",
    "push_fit": "push",
    "push_fit_friction": "push",
    "force_sensor": "force",
}
# Root mean square of the errors of a method that attains the limit of the simple model, where a
# frame breaks its assumptions: from its bias and its standard deviation in the table of limits.
SIMPLE: Final = {
    "x_c_simple_rms_mm": ("x_c_simple_bias_mm", "x_c_simple_sigma_mm"),
    "force_simple_rms_n": ("force_simple_bias_n", "force_simple_sigma_n"),
}
_KEYS: Final = ("frame_id", "information")
# Methods that use a moment sensor where there is one.
_WITH_SENSOR: Final = ("exact_fit_3d",)


def information_of(method: str, scene: dict[str, Any]) -> str:
    """Return the information set of a method by its name, of which the centreline is no part."""
    name = method.partition("@")[0]
    if name in _WITH_SENSOR and scene.get("moment_sensor") is not None:
        return "moment"
    return _OF_METHOD.get(name, "image")


def scored_limits(layout: Layout) -> pl.DataFrame | None:
    """Read the information limits of a dataset; None if they were never computed.

    Raises InputError for a table that is damaged, or was not written by `limits`.
    """
    limits, source = read_limits(layout), str(layout.derived / LIMITS)
    if limits is None:
        return None
    table = checked(limits, LIMIT_SCHEMA, source)
    if table.select(_KEYS).is_duplicated().any():
        raise InputError(f"{source}: a frame has two rows of one information set, allowed is one")
    return table


def with_limits(scores: pl.DataFrame, limits: pl.DataFrame | None) -> pl.DataFrame:
    """Add the information limits of each frame, and SIMPLE; null where there are none.

    `limits` has one row per `frame_id` and `information`, see `dataset.derived`. A limit that is
    not a positive number, or is absurdly small or large, counts as null.
    """
    columns = [quantity.limit for quantity in LIMITED]
    if limits is None:
        return scores.with_columns(pl.lit(None, pl.Float64).alias(n) for n in (*columns, *SIMPLE))
    positive = limits.select(
        "frame_id",
        "information",
        *(
            pl.when(pl.col(name).is_between(1 / LARGEST, LARGEST)).then(pl.col(name))
            for name in columns
        ),
        *(
            (pl.col(bias) ** 2 + pl.col(sigma) ** 2).sqrt().clip(upper_bound=LARGEST).alias(name)
            for name, (bias, sigma) in SIMPLE.items()
        ),
    )
    return scores.join(positive, on=_KEYS, how="left", validate="m:1")
