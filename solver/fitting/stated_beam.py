"""Test whether the beam of an image is the one that the rig states."""

import math
from collections.abc import Callable
from typing import Final, NamedTuple

import numpy as np

from solver.beams.beam import FRICTION_RATIO
from solver.fitting.alternative_taper import fit_alternative_taper, with_other_friction
from solver.fitting.frame_problem import FrameProblem, only
from solver.fitting.robust_fit import least_squares
from solver.instrument.arrays import Floats
from solver.instrument.estimate import Assumption
from solver.instrument.measurement import Measurement
from solver.uniform.fit import FrameFit
from solver.uniform.problem import Problem

# Sigmas of chi2 beyond which the parameters are not those that the rig states. Derived: nine
# parameters are so by chance once in ten thousand images. Of 600 images with true statements none
# had one sigma, because an image determines few of them.
_LARGEST: Final = 6.0
# Difference of two sums of squares, from which one explanation is better. Derived: three sigmas of
# one parameter.
_DISTINCT: Final = 9.0


class PriorConflict(NamedTuple):
    """How an image contradicts its rig, as a sentence, and which statement it contradicts most."""

    reason: str
    assumption: Assumption | None


def prior_conflict(
    measurement: Measurement,
    problem: Problem,
    stated_rod: FrameProblem,
    fit: FrameFit,
    gain: float,
    frame_problem: Callable[[Measurement, Problem], FrameProblem],
) -> PriorConflict | None:
    """Return how an image contradicts the beam that its rig states; None if it does not.

    `stated_rod` is what `frame_problem` makes of measurement and problem. Either the fit is too far
    from the rig's statements, or errors that neighbouring points share, which gain `gain` in twice
    the log likelihood, explain the points worse than another taper does: such errors could hide it.
    """
    rod = only(stated_rod, fit.kept)
    p = fit.p[: len(rod.mean)]
    stated = rod.free[np.diag(rod.information)[rod.free] > 0]
    away = (p - rod.mean)[stated]
    information = rod.information[np.ix_(stated, stated)]
    chi2 = float(away @ information @ away)
    if chi2 > len(stated) + _LARGEST * math.sqrt(2 * len(stated)):
        contradicted = _most_contradicted(_statements(rod), stated, away, information)
        own = rod.beam.prior.get(str(contradicted))
        if own is not None:
            return PriorConflict(
                f"the beam is {math.sqrt(chi2):.0f} sigmas from its prior, most by its parameter "
                f"'{contradicted}': it is {p[rod.parameters[str(contradicted)]]:.4g}, its prior "
                f"{own.mean:.4g} +- {own.sigma:.4g}",
                None,
            )
        assumption = contradicted if isinstance(contradicted, Assumption) else None
        most = "" if assumption is None else f", most by the {assumption}"
        return PriorConflict(
            f"the beam, its clamp or the friction is {math.sqrt(chi2):.0f} sigmas from what "
            f"rig.json states{most}: correct beam_shape, or learn the beam",
            assumption,
        )
    least = least_squares(rod, p) if gain else None
    if least is None:
        return None
    other = fit_alternative_taper(measurement, problem, fit.kept, frame_problem, p)
    if least.objective - other.objective < gain:
        return None
    assumption = Assumption.TAPER
    if rod.of_friction_ratio is Assumption.FRICTION:
        friction = with_other_friction(measurement, problem, fit.kept, frame_problem, p)
        assumption = _taper_or_friction(other.objective, friction)
    return PriorConflict(
        f"the beam is not that of rig.json: with a tip {other.tip:.2f} times as wide as at the "
        "clamp it fits better; state beam_shape.taper_sigma, or friction_sigma of rough objects, "
        "or learn the beam",
        assumption,
    )


def _taper_or_friction(with_taper: float, with_friction: float) -> Assumption:
    """Name what explains the points, from the sums of squares with either."""
    if abs(with_taper - with_friction) < _DISTINCT:
        return Assumption.TAPER_OR_FRICTION
    return Assumption.TAPER if with_taper < with_friction else Assumption.FRICTION


def _statements(rod: FrameProblem) -> dict[Assumption | str | None, list[int]]:
    """Return the parameters of a problem that belong to each statement of the rig.

    Those of None, errors that all points share, belong to no statement; those of a user's own beam
    have their names.
    """
    at = rod.parameters
    return {
        rod.of_friction_ratio: [FRICTION_RATIO],
        Assumption.TAPER: at.indices("widths"),
        Assumption.BOW: at.indices("bow"),
        Assumption.PLANE: at.indices("psi"),
        Assumption.CLAMP: at.indices("dx", "dy", "tilt", "softness"),
        **{name: at.indices(name) for name in rod.beam.prior},
        None: at.indices("errors"),
    }


def _most_contradicted(
    groups: dict[Assumption | str | None, list[int]],
    stated: Floats,
    away: Floats,
    information: Floats,
) -> Assumption | str | None:
    """Return the statement without which the deviation `away` (s,) would be the least.

    `stated` (s,) are the indices of the parameters, `information` (s, s) is that of their prior.
    """
    gradient = information @ away

    def decrease(indices: list[int]) -> float:
        rows = np.flatnonzero(np.isin(stated, indices))
        block = information[np.ix_(rows, rows)]
        return float(gradient[rows] @ np.linalg.pinv(block, hermitian=True) @ gradient[rows])

    return max(groups, key=lambda name: decrease(groups[name]))
