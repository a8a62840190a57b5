"""Errors over what is stated of them."""

from collections.abc import Mapping
from typing import Final

import numpy as np

from solver.instrument.estimate import Estimate

# Limit of a single error. Derived: a normal error exceeds it once in 26 million.
MOST_SIGMAS: Final = 5.5


def nees(estimate: Estimate, truth: Mapping[str, float]) -> float:
    """Square the errors over the stated covariance (normalised estimation error squared).

    It is chi^2, with a degree of freedom per quantity, where the covariance is honest.
    """
    names = list(estimate.values)
    rows = [names.index(name) for name in truth]
    error = np.array([estimate.values[name] - value for name, value in truth.items()])
    assert estimate.covariance is not None
    return float(error @ np.linalg.solve(estimate.covariance[np.ix_(rows, rows)], error))
