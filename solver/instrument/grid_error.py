"""Error of a centreline that repeats with the pixel grid, as a sum of waves over the image."""

from typing import NamedTuple

import numpy as np

from solver.instrument.arrays import Floats


class GridError(NamedTuple):
    """Waves of the place that is measured in a column, or in a row if not `upright`.

    `frequencies` (k, 2) [1/px] are those along the beam, over the number of the column, and across
    it, over the beam's place in the column. `coefficients` (2 k,) [px] are those of all cosines,
    then of all sines, and `covariance` (2 k, 2 k) [px^2] is theirs.
    """

    upright: bool
    frequencies: Floats
    coefficients: Floats
    covariance: Floats

    @property
    def across(self) -> "GridError":
        """The waves across the beam: those along it alone vanish where it follows the rows."""
        moving = self.frequencies[:, 1] > 0
        both = np.tile(moving, 2)
        covariance = self.covariance[np.ix_(both, both)]
        return GridError(
            self.upright, self.frequencies[moving], self.coefficients[both], covariance
        )

    @property
    def longest(self) -> float:
        """The longest wave across the beam [px], 0 without one."""
        frequencies = self.frequencies[self.frequencies[:, 1] > 0, 1]
        return 1 / float(frequencies.min()) if len(frequencies) else 0.0

    def at(self, along: Floats, across: Floats) -> Floats:
        """Compute the error (n,) [px] in columns `along` (n,) at places `across` (n,) [px]."""
        return np.asarray(self._waves(along, across) @ self.coefficients)

    def errors_at(self, along: Floats, across: Floats) -> Floats:
        """Compute the errors (n, 2 k) [px] of `at`, one sigma each of independent ones."""
        values, vectors = np.linalg.eigh(self.covariance)
        root = vectors * np.sqrt(np.maximum(values, 0.0))
        return np.asarray(self._waves(along, across) @ root)

    def _waves(self, along: Floats, across: Floats) -> Floats:
        phase = 2 * np.pi * np.column_stack([along, across]) @ self.frequencies.T
        return np.hstack([np.cos(phase), np.sin(phase)])
