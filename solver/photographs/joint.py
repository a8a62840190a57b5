"""Joint least squares of photographs that share a beam, a lens and the direction of gravity."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final

import numpy as np

from solver.core.least_squares import (
    Block,
    Minimum,
    NormalEquations,
    minimise,
    normal_equations,
)
from solver.core.parameters import Parameters
from solver.instrument.arrays import Floats
from solver.photographs.problem import OWN, PhotoProblem, shared_parameters

# Step [sigma] after which the fit has converged. Chosen: far below what noise moves.
_STEP_SIGMAS: Final = 0.01
# Places of a load that a step may lead to, over the length. Chosen: a load at the tip may have an
# estimate beyond it, and the curve ends at 1.05.
_PLACES: Final = (0.01, 1.045)


@dataclass(frozen=True)
class PhotosProblem:
    """Photographs and the prior of all parameters: the shared ones, then those of each photograph.

    `mean` (p,) and `information` (p, p) are the prior; `free` (f,) are the indices of the
    parameters that are fitted. `weights` are those of each photograph's points (n,), divided by
    what its variances are larger by than stated.
    """

    photos: tuple[PhotoProblem, ...]
    mean: Floats
    information: Floats
    free: Any
    weights: tuple[Floats, ...]

    @cached_property
    def parameters(self) -> Parameters:
        """Names of the shared parameters."""
        return shared_parameters(self.photos[0].widths)

    @property
    def shared(self) -> int:
        """Number of shared parameters."""
        return len(self.parameters)

    def columns(self, photo: int) -> list[int]:
        """Indices of the parameters of one photograph: the shared ones and its own."""
        first = self.shared + len(OWN) * photo
        return [*range(self.shared), *range(first, first + len(OWN))]

    def minimised(self, start: Floats) -> Minimum | None:
        """Fit from `start` (p,); None if no beam or no view has its parameters."""
        return minimise(self._system, start, self._moved, step_sigmas=_STEP_SIGMAS)

    def _system(self, p: Floats) -> NormalEquations | None:
        blocks = []
        for i, (photo, weights) in enumerate(zip(self.photos, self.weights, strict=True)):
            columns = np.array(self.columns(i))
            rows = photo.rows(p[columns])
            if rows is None:
                return None
            weight = np.concatenate([weights, np.ones(len(rows.residual) - len(weights))])
            chi2 = float(weight @ rows.residual**2)
            if not np.isfinite(chi2):
                return None
            blocks.append(Block(rows, columns, weight, chi2))
        return normal_equations(p, self.free, self.mean, self.information, tuple(blocks))

    def _moved(self, p: Floats, step: Floats) -> Floats:
        """Return the parameters (p,) after a step (p,), in which loads stay on the beam."""
        moved = p + step
        for i, photo in enumerate(self.photos):
            columns, own = np.array(self.columns(i)), self.shared
            q, place = columns[photo.parameters["q"]], columns[photo.parameters["s_c"]]
            # A load stays positive, and at most doubles.
            moved[q] = np.clip(moved[q], p[q] / 10, 2 * p[q])
            moved[place] = np.clip(moved[place], *_PLACES)
            with np.errstate(all="ignore"):
                moved[columns[own:]] = photo.moved(p[columns], (moved - p)[columns])[own:]
        return moved
