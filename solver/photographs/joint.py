"""Joint least squares of photographs that share a beam, a lens and the direction of gravity."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final, NamedTuple

import numpy as np

from solver.core.least_squares import (
    Block,
    Minimum,
    NormalEquations,
    minimise,
    normal_equations,
)
from solver.core.normal_equations import scaled_step
from solver.core.parameters import Parameters
from solver.instrument.arrays import Floats
from solver.photographs.problem import OWN, PhotoProblem, shared_parameters

# Step [sigma] after which the fit has converged. Chosen: far below what noise moves.
_STEP_SIGMAS: Final = 0.01
# Places of a load that a step may lead to, over the length. Chosen: a load at the tip may have an
# estimate beyond it, and the curve ends at 1.05.
PLACES: Final = (0.01, 1.045)
# Least load, over EI / L^2. Chosen: it bends the tip by a thirtieth of a thousandth of the length,
# less than a pixel.
LEAST_LOAD: Final = 1e-4


class Bounds(NamedTuple):
    """Least and largest parameters, (p,) each."""

    low: Floats
    high: Floats


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

    @cached_property
    def bounds(self) -> Bounds:
        """Least and largest parameters, (p,) each: of a load and its place, infinite else."""
        low, high = np.full(len(self.mean), -np.inf), np.full(len(self.mean), np.inf)
        for i, photo in enumerate(self.photos):
            load, place = (self.columns(i)[photo.parameters[name]] for name in ("q", "s_c"))
            low[place], high[place] = PLACES
            if photo.load:
                low[load] = LEAST_LOAD
        return Bounds(low, high)

    def _system(self, p: Floats) -> NormalEquations | None:
        """Compute the normal equations of the parameters that no bound stops."""
        of_all = self.equations(p)
        if of_all is None:
            return None
        low, high = (bound[self.free] for bound in self.bounds)
        at, gradient = p[self.free], of_all.gradient
        kept = np.flatnonzero(~((at <= low) & (gradient > 0) | (at >= high) & (gradient < 0)))
        if len(kept) == len(gradient):
            return of_all
        gradient, newton = gradient[kept], np.empty(len(kept))
        normal = np.ascontiguousarray(of_all.normal[np.ix_(kept, kept)])
        length = scaled_step(normal, gradient, 0.0, newton)
        return of_all._replace(
            free=self.free[kept], gradient=gradient, normal=normal, newton=newton, length=length
        )

    def equations(self, p: Floats) -> NormalEquations | None:
        """Compute the normal equations at p (p,); None if no beam or no view has it."""
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
        """Return the parameters (p,) after a step (p,), in which loads stay on the beam.

        EI, length and focal length change by a factor of e at most.
        """
        scales = self.parameters.indices("rigidity", "length", "focal")
        moved = p + step
        moved[scales] = np.clip(moved[scales], p[scales] - 1, p[scales] + 1)
        for i, photo in enumerate(self.photos):
            columns, own = np.array(self.columns(i)), self.shared
            if photo.load:
                # A load at most doubles.
                load = columns[photo.parameters["q"]]
                moved[load] = np.clip(moved[load], p[load] / 10, 2 * p[load])
            with np.errstate(all="ignore"):
                stopped = np.clip(moved, *self.bounds)
                moved[columns[own:]] = photo.moved(p[columns], (stopped - p)[columns])[own:]
        return moved
