"""Faults of an estimate that its table cannot show: those of its covariance."""

from typing import Final

import numpy as np

from solver.instrument.estimate import Estimate

# Relative asymmetry, and the most negative eigenvalue of the correlations, that rounding explains.
# Measured: covariances of derived quantities are singular, with eigenvalues down to -1e-9.
_ROUNDING: Final = 1e-6


def estimate_faults(estimate: object) -> list[str]:
    """List faults of an estimate's covariance as sentences; none for anything else.

    Sizes and values that are not finite are refused by `Estimate` itself.
    """
    if not isinstance(estimate, Estimate) or estimate.covariance is None:
        return []
    covariance = np.asarray(estimate.covariance)
    variances = np.diag(covariance)
    without = [
        name for name, variance in zip(estimate.values, variances, strict=True) if variance <= 0
    ]
    if without:
        return [f"the covariance has no positive variance for {', '.join(without)}"]
    sigmas = np.sqrt(variances)
    correlations = covariance / np.outer(sigmas, sigmas)
    if np.abs(correlations - correlations.T).max() > _ROUNDING:
        return ["the covariance is not symmetric"]
    if np.linalg.eigvalsh(correlations)[0] < -_ROUNDING * len(sigmas):
        return ["the covariance is not positive definite"]
    return []
