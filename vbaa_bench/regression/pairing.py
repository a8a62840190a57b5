"""Pairs of frames of a run and of a baseline of the same scene."""

from pathlib import Path
from typing import Final

import polars as pl

from solver.instrument.errors import InputError
from vbaa_bench.regression.scored_run import NUMBERS, PLACE, RESULTS, TEXTS, ScoredRun

# Chosen: far above the six stored digits and the change of a contact by gravity at another motor
# angle, far below the distance of two trials.
_SAME: Final = 1e-3
_NEW: Final = "_new"


def pair(old: ScoredRun, new: ScoredRun, path: Path) -> pl.DataFrame:
    """Pair the frames of a baseline, read from `path`, with those of a run, for each method.

    Frames are paired by rig, trial and method. Their true parameters must agree: texts exactly,
    numbers to 0.1 %. The parameters and `push_id` are those of the run; results of the baseline
    have their own names, and those of the run end with `_new`. Raises InputError if no frame is
    paired.
    """
    joined = old.frames.drop("push_id", strict=False).join(
        new.frames, on=[*PLACE, "method"], how="inner", suffix=_NEW, maintain_order="right"
    )
    scale = {name: pl.max_horizontal(pl.col(name).abs(), _new(name).abs()) for name in NUMBERS}
    same = [pl.col(name).eq_missing(_new(name)) for name in TEXTS]
    same += [
        (pl.col(name).is_null() & _new(name).is_null())
        | ((pl.col(name) - _new(name)).abs() <= _SAME * scale[name]).fill_null(value=False)
        for name in NUMBERS
    ]
    paired = joined.filter(pl.all_horizontal(same))
    if paired.is_empty():
        reason = "no common method" if joined.is_empty() else "other true parameters"
        raise InputError(f"{path}: no frame can be compared with the run ({reason})")
    return paired.select(
        *PLACE,
        "method",
        "push_id",
        *(_new(name).alias(name) for name in (*TEXTS, *NUMBERS)),
        *RESULTS,
        *(f"{name}{_NEW}" for name in RESULTS),
    )


def _new(name: str) -> pl.Expr:
    return pl.col(f"{name}{_NEW}")
