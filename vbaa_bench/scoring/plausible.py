"""Warnings about predictions that seem to use other columns or units than the scored ones."""

import difflib
import math
from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np
import polars as pl

from solver.instrument.arrays import Floats
from solver.instrument.errors import truncated
from solver.lab.table import COLUMNS
from vbaa_bench.scoring.scored_quantities import NUMBERS

_KNOWN: Final = ("frame_id", "outcome", "message", "assumption", "information", *NUMBERS)
# Threshold of the ratio of median estimate to median truth, or its inverse, for a warning: the
# geometric mean of 1 and the factor of the nearest wrong unit, 10 for centimetres, 57.3 for
# radians, 1000 for mN.
_MAX_RATIO: Final = {
    "x_c_mm": math.sqrt(10),
    "s_c_mm": math.sqrt(10),
    "theta_c_deg": math.sqrt(180 / math.pi),
    "force_n": math.sqrt(1000),
    "f_n": math.sqrt(1000),
}
# Units in which a column may be by mistake: the factor of its values, by the column's own unit.
_WRONG_UNITS: Final = {
    "mm": {1e-3: "m", 0.1: "cm", 1e3: "um"},
    "deg": {math.pi / 180: "radians"},
    "n": {1e3: "mN", 1 / 9.81: "kgf", 1e3 / 9.81: "gf"},
}
# A ratio is that of a unit if it differs from its factor by less. Derived: half the distance, in
# logarithms, of the nearest two factors, 1 and 9.81.
NEAR: Final = math.sqrt(9.81)
# Chosen: more unknown columns are counted, not named.
_MAX_NAMED: Final = 10


def unknown_columns(columns: Sequence[str], source: str) -> Iterator[str]:
    """Yield a sentence for each column that is not scored, with the known name nearest to it."""
    unknown = [name for name in columns if name not in _KNOWN and name not in COLUMNS]
    for name in unknown[:_MAX_NAMED]:
        near = difflib.get_close_matches(truncated(name), _KNOWN, n=1, cutoff=0.7)
        hint = f"; did you mean {near[0]}?" if near else ""
        yield f"{source}: the column {truncated(name)} is unknown and not scored{hint}"
    if len(unknown) > _MAX_NAMED:
        yield f"{source}: {len(unknown) - _MAX_NAMED} further columns are unknown and not scored"


def doubtful_units(scores: pl.DataFrame, source: str) -> Iterator[str]:
    """Yield a warning for each quantity that differs from the truth by a unit's factor."""
    for column, factor in _MAX_RATIO.items():
        pairs = scores.select(pl.col(column).abs(), pl.col(f"true_{column}").abs()).drop_nulls()
        if pairs.is_empty():
            continue
        estimated, true = (_median(pairs[name].to_numpy()) for name in pairs.columns)
        if estimated > 0 and true > 0 and not 1 / factor < estimated / true < factor:
            yield (
                f"{source}: the median of {column} is {estimated:.3g}, of the truth {true:.3g}; "
                f"{_mistake(estimated / true, column.rpartition('_')[2])}"
            )


def _mistake(ratio: float, unit: str) -> str:
    """Name the unit whose factor is the nearest to the ratio of estimate to truth, if it is near.

    `unit` is the unit that the values should have.
    """
    factors = _WRONG_UNITS[unit]
    factor = min(factors, key=lambda value: abs(math.log(ratio / value)))
    shown = unit.replace("n", "N")
    if abs(math.log(ratio / factor)) < math.log(NEAR):
        return f"it seems to be in {factors[factor]} instead of {shown}"
    return f"is it in {shown}?"


def _median(values: Floats) -> float:
    middle = len(values) // 2
    return float(np.partition(values, middle)[middle])
