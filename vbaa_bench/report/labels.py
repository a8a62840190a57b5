"""Placement of labels beside a plot, as near to their points as possible without overlap."""

import numpy as np
from scipy.optimize import isotonic_regression

from solver.instrument.arrays import Floats


def spread(wanted: Floats, gap: float) -> Floats:
    """Compute places (n,) at least `gap` apart, in the order of `wanted` (n,) and nearest to it.

    The sum of squared distances is minimised: after subtracting i * gap from the i-th place, places
    must not decrease, which is isotonic regression.
    """
    order = np.argsort(wanted, kind="stable")
    steps = gap * np.arange(len(order))
    places = np.empty(len(order))
    places[order] = isotonic_regression(np.asarray(wanted, float)[order] - steps).x + steps
    return places
