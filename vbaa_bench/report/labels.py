"""Labels beside a plot, as near to their points as they can be without touching."""

import numpy as np
from scipy.optimize import isotonic_regression

from solver.instrument.arrays import Floats


def spread(wanted: Floats, gap: float) -> Floats:
    """Places (n,) at least `gap` apart, in the order of `wanted` (n,), nearest to it.

    Nearest in the sum of squares: with i gaps taken off, places must only not fall, which is
    isotonic regression.
    """
    order = np.argsort(wanted, kind="stable")
    steps = gap * np.arange(len(order))
    places = np.empty(len(order))
    places[order] = isotonic_regression(np.asarray(wanted, float)[order] - steps).x + steps
    return places
