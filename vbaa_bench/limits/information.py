"""Fisher information of independent data on named parameters: sums, and what they determine."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from solver.instrument.arrays import Floats

# Eigenvalues below this fraction of the largest one are rounding errors: these combinations of
# parameters are undetermined. Parameters are scaled so that each alone has the information 1.
# Measured: derivatives have errors of 1e-6, and information has the square of that.
_UNDETERMINED: Final = 1e-12
# A quantity is undetermined if this fraction of the square of its gradient is. Chosen.
_OUTSIDE: Final = 1e-6


@dataclass(frozen=True)
class Information:
    """Information `matrix` (p, p) of some data on p parameters, in their SI units."""

    names: tuple[str, ...]
    matrix: Floats

    @classmethod
    def of_priors(cls, sigmas: Mapping[str, float]) -> "Information":
        """Return the information of independent measurements of parameters with these sigmas.

        A sigma of 0 states nothing: the parameter is left out.
        """
        stated = {name: sigma for name, sigma in sigmas.items() if sigma}
        return cls(tuple(stated), np.diag([1 / sigma**2 for sigma in stated.values()]))

    @classmethod
    def of_readings(
        cls, names: tuple[str, ...], gradients: Floats, sigmas: Floats
    ) -> "Information":
        """Return the information of r readings with `sigmas` (r,) and `gradients` (r, p)."""
        weighted = gradients / sigmas[:, None]
        return cls(names, weighted.T @ weighted)

    def __add__(self, other: "Information") -> "Information":
        """Return the information of both data together; each informs on its own parameters."""
        names = tuple(dict.fromkeys((*self.names, *other.names)))
        total = np.zeros((len(names),) * 2)
        for one in (self, other):
            places = [names.index(name) for name in one.names]
            total[np.ix_(places, places)] += one.matrix
        return Information(names, total)

    def renamed(self, names: Mapping[str, str]) -> "Information":
        """Return the same information on parameters with other names."""
        return Information(tuple(names.get(name, name) for name in self.names), self.matrix)

    def mapped(self, names: tuple[str, ...], changes: Mapping[str, Floats]) -> "Information":
        """Return the information on parameters of which the present ones are functions.

        `changes` holds the gradients (p,) with respect to `names` of those that are replaced; the
        others are kept, and may be among `names`.
        """
        kept = tuple(name for name in self.names if name not in changes and name not in names)
        all_names = (*names, *kept)
        jacobian = np.zeros((len(self.names), len(all_names)))
        for row, name in enumerate(self.names):
            if name in changes:
                jacobian[row, : len(names)] = changes[name]
            else:
                jacobian[row, all_names.index(name)] = 1.0
        return Information(all_names, jacobian.T @ self.matrix @ jacobian)

    def without(self, known: Collection[str]) -> "Information":
        """Return the information on the other parameters where the `known` ones are known."""
        kept = [i for i, name in enumerate(self.names) if name not in known]
        return Information(tuple(self.names[i] for i in kept), self.matrix[np.ix_(kept, kept)])

    def eliminated(self, unknown: Collection[str]) -> "Information":
        """Return the information on the other parameters if no other data inform on `unknown`.

        It is the Schur complement.
        """
        out = [i for i, name in enumerate(self.names) if name in unknown]
        kept = [i for i in range(len(self.names)) if i not in out]
        mixed = self.matrix[np.ix_(out, kept)]
        inverse = pseudo_inverse(self.matrix[np.ix_(out, out)])
        reduced = self.matrix[np.ix_(kept, kept)] - mixed.T @ inverse @ mixed
        return Information(tuple(self.names[i] for i in kept), (reduced + reduced.T) / 2)

    def sigmas(self, gradients: Floats, errorless: "Information | None" = None) -> Floats:
        """Compute the least standard deviations (q,) of quantities with gradients (q, p).

        They are those of Cramer and Rao for unbiased estimates; infinite where a quantity is
        undetermined. `errorless` is the part of the information whose data have no error here,
        although a method must expect one. The efficient estimate weights all data as stated, and
        these add nothing to its error.
        """
        scaled, scale = _scaled(self.matrix)
        values, vectors = np.linalg.eigh(scaled)
        # In scaled parameters a gradient is divided by their scale, which is 1 / scale.
        along = (gradients * scale) @ vectors
        determined = values > _UNDETERMINED * values[-1]
        inverse = np.where(determined, 1 / np.where(determined, values, 1.0), 0.0)
        variances = (along**2 * inverse).sum(axis=1)
        if errorless is not None:
            gains = (along * inverse) @ vectors.T * scale
            added = (Information(self.names, np.zeros_like(self.matrix)) + errorless).matrix
            variances -= np.einsum("qi,ij,qj->q", gains, added, gains)
        outside = (along[:, ~determined] ** 2).sum(axis=1)
        undetermined = outside > _OUTSIDE * (along**2).sum(axis=1)
        return np.where(undetermined, np.inf, np.sqrt(np.maximum(variances, 0.0)))

    def gradients(self, quantities: Collection[Mapping[str, float]]) -> Floats:
        """Arrange gradients by parameter as an array (q, p); a missing one is zero."""
        rows = [[quantity.get(name, 0.0) for name in self.names] for quantity in quantities]
        return np.array(rows).reshape(-1, len(self.names))


def pseudo_inverse(matrix: Floats) -> Floats:
    """Invert a symmetric matrix (p, p) on the combinations of parameters that it determines."""
    scaled, scale = _scaled(matrix)
    inverse = np.linalg.pinv(scaled, rcond=_UNDETERMINED, hermitian=True)
    return np.asarray(inverse * np.outer(scale, scale))


def _scaled(matrix: Floats) -> tuple[Floats, Floats]:
    """Scale parameters to unit information of each alone; return also their scale (p,)."""
    own = np.diag(matrix)
    scale = np.where(own > 0, 1 / np.sqrt(np.where(own > 0, own, 1.0)), 1.0)
    return matrix * np.outer(scale, scale), scale
