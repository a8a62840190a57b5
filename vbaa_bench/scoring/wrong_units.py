"""Estimates in another unit than the stated one, recognised by their ratio to the truth."""

import math
from collections.abc import Iterator
from typing import Final

import numpy as np
import polars as pl

from solver.instrument.arrays import Floats

# Units of a length, an angle, a force, ..., each in the first of its line.
_SIZES: Final = (
    {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6},
    {"radians": 1.0, "degrees": math.pi / 180},
    {"N": 1.0, "mN": 1e-3, "kgf": 9.81, "gf": 9.81e-3},
    {"m/N": 1.0, "mm/N": 1e-3},
    {"N/m": 1.0, "N/mm": 1e3},
)
# A ratio is that of a unit if it differs from its factor by less. Derived: half the distance, in
# logarithms, of the nearest two factors, 1 and 9.81.
NEAR: Final = math.sqrt(9.81)
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
# Units of these columns, by the suffixes of their names.
_UNITS: Final = {"mm": "mm", "deg": "degrees", "n": "N"}


def factors(unit: str) -> dict[float, str]:
    """Return the units of the same kind as `unit`, by the factor of values that are in them."""
    sizes = next(sizes for sizes in _SIZES if unit in sizes)
    return {sizes[unit] / size: other for other, size in sizes.items() if other != unit}


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


def _mistake(ratio: float, suffix: str) -> str:
    """Name the unit whose factor is the nearest to the ratio of estimate to truth, if it is near.

    `suffix` is that of the column, whose unit the values should have.
    """
    units = factors(_UNITS[suffix])
    factor = min(units, key=lambda value: abs(math.log(ratio / value)))
    shown = suffix.replace("n", "N")
    if abs(math.log(ratio / factor)) < math.log(NEAR):
        return f"it seems to be in {units[factor]} instead of {shown}"
    return f"is it in {shown}?"


def _median(values: Floats) -> float:
    middle = len(values) // 2
    return float(np.partition(values, middle)[middle])
