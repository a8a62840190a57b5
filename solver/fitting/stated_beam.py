"""Test whether the beam of an image is the one that the rig states."""

import math
from collections.abc import Callable
from typing import Final

import numpy as np

from solver.fitting.fit import FrameFit
from solver.fitting.problem import Problem
from solver.fitting.rival_taper import other_taper
from solver.fitting.rod_fit import least_squares
from solver.fitting.rod_problem import RodProblem, only
from solver.instrument.measurement import Measurement

# Sigmas of chi2 beyond which the parameters are not those that the rig states. Derived: nine
# parameters are so by chance once in ten thousand images. Of 600 images with true statements none
# had one sigma, because an image determines few of them.
_LARGEST: Final = 6.0


def contradiction(
    measurement: Measurement,
    problem: Problem,
    fit: FrameFit,
    gain: float,
    rod_problem: Callable[[Measurement, Problem], RodProblem],
) -> str:
    """Return how an image contradicts the beam that its rig states, or "".

    Either the fit is too far from the rig's statements, or errors that neighbouring points share,
    which gain `gain` in twice the log likelihood, explain the points worse than another taper does:
    such errors could hide it.
    """
    rod = only(rod_problem(measurement, problem), fit.kept)
    p = fit.p[: len(rod.mean)]
    stated = rod.free[np.diag(rod.information)[rod.free] > 0]
    away = (p - rod.mean)[stated]
    chi2 = float(away @ rod.information[np.ix_(stated, stated)] @ away)
    if chi2 > len(stated) + _LARGEST * math.sqrt(2 * len(stated)):
        return (
            f"the beam, its clamp or the friction is {math.sqrt(chi2):.0f} sigmas from what "
            "rig.json states: correct beam_shape, or learn the beam"
        )
    least = least_squares(rod, p) if gain else None
    if least is None:
        return ""
    other = other_taper(measurement, problem, fit.kept, rod_problem, p)
    if least.objective - other.objective < gain:
        return ""
    return (
        f"the beam is not that of rig.json: with a tip {other.tip:.2f} times as wide as at the "
        "clamp it fits better; state beam_shape.taper_sigma, or friction_sigma of rough objects, "
        "or learn the beam"
    )
