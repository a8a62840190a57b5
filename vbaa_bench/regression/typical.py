"""Typical values of pushes and of sets of pushes."""

import numpy as np
import polars as pl

from solver.instrument.arrays import Floats
from vbaa_bench.regression.compared import ComparedQuantity


def of_push(quantity: ComparedQuantity, column: str) -> pl.Expr:
    """Aggregate the frames of a push, on the scale on which changes are differences.

    This is the logarithm of the root mean square of a magnitude, or the mean of a rate. The
    tolerance is added to the squares: errors far below it are equal, and none is zero.
    """
    if quantity.kind == "rate":
        return pl.col(column).mean()
    return (pl.col(column).pow(2).mean() + quantity.tolerance**2).log() / 2


def of_set(quantity: ComparedQuantity, push_values: Floats) -> float:
    """Average values of `of_push` (n,): the geometric mean of magnitudes, the mean of rates."""
    mean = float(np.mean(push_values))
    return mean if quantity.kind == "rate" else float(np.exp(mean))
