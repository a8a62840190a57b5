"""Minimise a sum of squares and a prior by damped Gauss-Newton steps: the loop of the fits.

What is minimised computes its normal equations at given parameters; this module takes the steps.
Residuals are in sigmas, so that the length of a step is in sigmas too: the noise, not the rounding,
sets where an iteration ends.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final, NamedTuple, Protocol

import numpy as np

from solver.core.normal_equations import add_prior, add_rows, scaled_step
from solver.instrument.arrays import Floats

CONVERGED, STOPPED, DEFICIENT = range(3)
# Step [sigma] after which a fit has converged. Chosen: far below what noise moves.
STEP_SIGMAS: Final = 0.001
_MAX_ITERATIONS: Final = 100
# Levenberg and Marquardt's damping after a step that failed for the first time, its factor, and the
# largest. Chosen.
_FIRST_DAMPING, _FACTOR, _MAX_DAMPING = 1e-6, 10.0, 1e6
# Length of a step [sigma] that is near the minimum. Chosen: there the objective hardly changes.
_NEAR: Final = 5.0
# Parts of a step that are tried before it is damped. Chosen: a shorter one is no faster than a
# damped one.
_PARTS: Final = (1.0, 0.5, 0.25, 0.125, 0.0625)
# Pivot or eigenvalue of scaled normal equations below which they do not determine a direction.
# Chosen: well above rounding.
MIN_PIVOT: Final = 1e-12
# Least variance of a combination of a prior's parameters, over those of its parts. Chosen: a
# ten-thousandth of their sigmas is certain.
_CERTAIN: Final = 1e-8


class Rows(NamedTuple):
    """Residuals (n,) in sigmas, and their Jacobian (p, n)."""

    residual: Floats
    jacobian: Floats


class Step(NamedTuple):
    """Change (p,) of the parameters, and its length in sigmas."""

    change: Floats
    length: float


class System(Protocol):
    """Sum of squares, `objective`, at the parameters `p` (p,), and its normal equations there.

    `length` is that of `step(0)` in sigmas, NaN where that is None.
    """

    @property
    def p(self) -> Floats:
        """Parameters (p,)."""
        ...

    @property
    def objective(self) -> float:
        """Sum of squares of residuals and prior."""
        ...

    @property
    def length(self) -> float:
        """Length of the undamped step [sigma]."""
        ...

    def step(self, damping: float) -> Step | None:
        """Solve the damped normal equations; None where they are singular."""
        ...


class NormalEquations(NamedTuple):
    """A `System` whose normal matrix is dense: `gradient` (f,) and `normal` (f, f).

    They are half the gradient and half the second derivative of the objective by the parameters
    with the indices `free` (f,); `newton` (f,) is the undamped step. `rows` are what they were
    computed from.
    """

    p: Floats
    objective: float
    free: Any
    gradient: Floats
    normal: Floats
    newton: Floats
    length: float
    rows: tuple[Rows, ...]

    def step(self, damping: float) -> Step | None:
        """Solve the damped normal equations; None where they are singular."""
        step, length = self.newton, self.length
        if damping:
            step = np.empty_like(self.newton)
            length = scaled_step(self.normal, self.gradient, damping, step)
        if not math.isfinite(length):
            return None
        change = np.zeros_like(self.p)
        change[self.free] = step
        return Step(change, length)

    def covariance(self) -> Floats | None:
        """Invert the normal matrix: (p, p), zero for fixed parameters.

        Return None if a direction is undetermined.
        """
        unit = np.sqrt(np.diag(self.normal))
        if not (unit > 0).all() or not np.isfinite(self.normal).all():
            return None
        scaled = self.normal / np.outer(unit, unit)
        if np.linalg.eigvalsh(scaled)[0] < MIN_PIVOT:
            return None
        covariance = np.zeros((len(self.p), len(self.p)))
        covariance[np.ix_(self.free, self.free)] = np.linalg.inv(scaled) / np.outer(unit, unit)
        return covariance


@dataclass(frozen=True)
class BorderedEquations:
    """A `System` of n frames that share s parameters, and have o parameters each of their own.

    The parameters p are the shared ones, and then those of each frame. The second derivative has
    the blocks `shared` (s, s), `own` (n, o, o), `mixed` (n, o, s); the gradient `shared_gradient`
    (s,), `own_gradient` (n, o). The frames' own parameters are eliminated (Schur complement), so
    that the size of the system that is solved does not grow with the number of frames.
    """

    p: Floats
    objective: float
    shared: Floats
    own: Floats
    mixed: Floats
    shared_gradient: Floats
    own_gradient: Floats

    @cached_property
    def length(self) -> float:
        """Length of the undamped step [sigma]."""
        step = self.step(0.0)
        return math.nan if step is None else step.length

    def step(self, damping: float) -> Step | None:
        """Solve the damped normal equations; None where they are singular."""
        unit = np.sqrt(np.diag(self.shared))
        if not (unit > 0).all():
            return None
        try:
            matrix, gradient, inverse = self._reduced(damping)
            root = np.linalg.cholesky(matrix / np.outer(unit, unit))
        except np.linalg.LinAlgError:
            return None
        of_shared = -np.linalg.solve(root.T, np.linalg.solve(root, gradient / unit)) / unit
        of_own = -np.einsum("nop,np->no", inverse, self.own_gradient + self.mixed @ of_shared)
        change = np.append(of_shared, of_own)
        gradient = np.append(self.shared_gradient, self.own_gradient)
        return Step(change, math.sqrt(max(float(-change @ gradient), 0.0)))

    def shared_covariance(self) -> Floats | None:
        """Compute the covariance (s, s) of the shared parameters.

        A direction of which only rounding is left has a large sigma. Return None if a frame does
        not determine its own parameters.
        """
        unit = np.sqrt(np.diag(self.shared))
        try:
            reduced, _, _ = self._reduced(0.0)
        except np.linalg.LinAlgError:
            return None
        values, vectors = np.linalg.eigh(reduced / np.outer(unit, unit))
        inverse = (vectors / np.maximum(values, MIN_PIVOT)) @ vectors.T
        return np.asarray(inverse / np.outer(unit, unit))

    def _reduced(self, damping: float) -> tuple[Floats, Floats, Floats]:
        """Compute the reduced matrix (s, s), its gradient (s,), the inverse own blocks."""
        own, diagonal = self.own.copy(), np.arange(self.own.shape[1])
        own[:, diagonal, diagonal] *= 1 + damping
        inverse = np.asarray(np.linalg.inv(own), dtype=np.float64)
        matrix = self.shared - np.einsum("nos,nop,npt->st", self.mixed, inverse, self.mixed)
        matrix[np.diag_indices_from(matrix)] += damping * np.diag(self.shared)
        eliminated = np.einsum("nos,nop,np->s", self.mixed, inverse, self.own_gradient)
        return (matrix + matrix.T) / 2, self.shared_gradient - eliminated, inverse


class Block(NamedTuple):
    """Rows of some of the parameters, those with the indices `columns`, and their weights (n,).

    The weighted sum of squares is `chi2`.
    """

    rows: Rows
    columns: Any
    weight: Floats
    chi2: float


def whole(rows: Rows) -> Block:
    """Return rows of all parameters as a block, each of the same weight."""
    residual, jacobian = rows
    chi2 = float(residual @ residual)
    return Block(rows, np.arange(len(jacobian)), np.ones(len(residual)), chi2)


def information_of(covariance: Floats) -> Floats:
    """Invert the covariance (p, p) of a prior, which may be singular, as where a bow is undecided.

    Parameters without variance have neither information nor correlation: they are fixed, or open.
    """
    uncertain = np.flatnonzero(np.diag(covariance) > 0)
    block = np.ix_(uncertain, uncertain)
    # In units of the sigmas, which differ by orders of magnitude.
    sigmas = np.sqrt(np.diag(covariance)[uncertain])
    unit = np.outer(sigmas, sigmas)
    values, vectors = np.linalg.eigh(covariance[block] / unit)
    information = np.zeros_like(covariance)
    information[block] = (vectors / np.maximum(values, _CERTAIN)) @ vectors.T / unit
    return information


def normal_equations(
    p: Floats, free: Any, mean: Floats, information: Floats, blocks: tuple[Block, ...]
) -> NormalEquations:
    """Assemble the normal equations at p (p,) of some blocks, with a prior of all parameters.

    The prior has `mean` (p,) and `information` (p, p); those `free` (f,) are fitted.
    """
    size = len(free)
    place = np.full(len(p), -1)
    place[free] = np.arange(size)
    gradient, normal, step = np.zeros(size), np.zeros((size, size)), np.empty(size)
    objective = add_prior(p, mean, information, free, gradient, normal)
    for (residual, jacobian), columns, weight, chi2 in blocks:
        objective += chi2
        add_rows(residual, jacobian, weight, place[columns], gradient, normal)
    length = scaled_step(normal, gradient, 0.0, step)
    rows = tuple(block.rows for block in blocks)
    return NormalEquations(p, objective, free, gradient, normal, step, length, rows)


@dataclass(frozen=True)
class Fit:
    """Minimum: parameters (p,), covariance (p, p) = (J J^T)^-1, chi^2, iterations.

    `rank_deficient` is True if the data do not determine a direction of the parameters; the
    covariance is then NaN.
    """

    parameters: Floats
    covariance: Floats
    chi2: float
    iterations: int
    converged: bool
    rank_deficient: bool


class Minimum(NamedTuple):
    """Normal equations where an iteration ended, and why: CONVERGED or STOPPED."""

    at: Any
    status: int
    iterations: int


def straight(p: Floats, step: Floats) -> Floats | None:
    """Return the parameters (p,) after a step (p,): their sum."""
    return p + step


def minimise(
    system: Callable[[Floats], System | None],
    start: Floats,
    moved: Callable[[Floats, Floats], Floats | None] = straight,
    *,
    step_sigmas: float = STEP_SIGMAS,
    max_iterations: int = _MAX_ITERATIONS,
    at_edges: bool = False,
) -> Minimum | None:
    """Minimise from `start` (p,); return None if it is outside the model's domain, or of numbers.

    `system(p)` computes normal equations, or None outside the domain; `moved(p, step)` the
    parameters after a step, which may follow a curved valley, or None where it is too long. With
    `at_edges` the iteration also ends where only damping makes steps short, as at the edge of the
    domain.
    """

    def computed(p: Floats) -> System | None:
        # A wild step may lead beyond the range of numbers.
        with np.errstate(all="ignore"):
            at = system(p)
        return at if at is not None and math.isfinite(at.objective) else None

    def after(change: Floats) -> System | None:
        trial = moved(at.p, change)
        return None if trial is None else computed(trial)

    first = computed(start)
    if first is None:
        return None
    at, damping = first, 0.0
    for iteration in range(1, max_iterations + 1):
        step = at.step(damping)
        if step is None:
            trial = None
        elif damping == 0:
            trial = _undamped(at, step, after, step_sigmas)
        else:
            # Where rounding hides a decrease, only strongly damped, short steps are accepted.
            trial = _lower(at, after(step.change))
        if trial is not None and step is not None:
            # A damped step may be short far from the minimum.
            near = step.length < step_sigmas and (
                damping == 0 or at_edges or at.length < step_sigmas
            )
            at, damping = trial, damping / _FACTOR if damping > _FIRST_DAMPING else 0.0
            if near:
                return Minimum(at, CONVERGED, iteration)
        else:
            damping = max(damping * _FACTOR, _FIRST_DAMPING)
            if damping > _MAX_DAMPING:
                break
    return Minimum(at, STOPPED, iteration)


def fit_rows(
    rows: Callable[[Floats], Rows | None], start: Floats, *, step_sigmas: float = STEP_SIGMAS
) -> Fit:
    """Minimise the sum of squared residuals, without a prior, from `start` (p,).

    `rows(p)` computes residuals and Jacobian, or None outside the model's domain. Raises ValueError
    if the start is outside.
    """
    free, nothing = np.arange(len(start)), np.zeros((len(start), len(start)))

    def system(p: Floats) -> NormalEquations | None:
        at = rows(p)
        return None if at is None else normal_equations(p, free, p, nothing, (whole(at),))

    found = minimise(system, start, step_sigmas=step_sigmas)
    if found is None:
        raise ValueError("the start is outside the model's domain")
    covariance = found.at.covariance()
    return Fit(
        parameters=found.at.p,
        covariance=np.full_like(nothing, np.nan) if covariance is None else covariance,
        chi2=found.at.objective,
        iterations=found.iterations,
        converged=found.status == CONVERGED,
        rank_deficient=covariance is None,
    )


def _undamped(
    at: System, step: Step, after: Callable[[Floats], System | None], step_sigmas: float
) -> System | None:
    """Return where the largest part of a step leads that is better; None if none is.

    Near the minimum, where the objective hardly changes, a part is better if the next step is
    shorter, or if the objective falls by at least a quarter of what is expected.
    """
    for part in _PARTS:
        trial = after(part * step.change)
        if step.length >= _NEAR:
            trial = _lower(at, trial)
        elif trial is not None:
            shorter = trial.length < (1 - part / 4) * step.length or step.length < step_sigmas
            better = trial.objective <= at.objective - part * step.length**2 / 4
            trial = trial if shorter or better else None
        if trial is not None:
            return trial
    return None


def _lower(at: System, trial: System | None) -> System | None:
    """Return the trial if its objective is not higher, but for rounding."""
    return trial if trial is not None and trial.objective <= at.objective * (1 + 1e-9) else None
