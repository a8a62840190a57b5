"""Classify an estimated contact: a contact, an interval, one at the tip, or none."""

import math
from collections.abc import Mapping

from solver.core.thresholds import THRESHOLDS
from solver.instrument.arrays import Floats
from solver.instrument.estimate import Assumption, Estimate, Outcome
from solver.instrument.rig import Rig


def classified_estimate(
    rig: Rig,
    values: Mapping[str, float],
    covariance: Floats,
    message: str = "",
    *,
    chi2: float | None = None,
    dof: int | None = None,
    iterations: int | None = None,
) -> Estimate:
    """Return the estimate of a contact, or a failure outcome if the rig's beam cannot have it.

    The contact arc length, or the contact distance if a method does not estimate it, is compared
    with the beam's length and its tolerance.
    """

    def sigma(name: str) -> float:
        index = list(values).index(name)
        return math.sqrt(max(float(covariance[index, index]), 0.0))

    position = "s_c_m" if "s_c_m" in values else "x_c_m"
    outcome, reason = verdict(
        rig, values["x_c_m"], sigma("x_c_m"), values[position], sigma(position)
    )
    has_values = outcome.has_values
    beyond_tip = outcome is Outcome.INVALID
    return Estimate(
        outcome,
        message if has_values else reason,
        values=values if has_values else {},
        covariance=(covariance + covariance.T) / 2 if has_values else None,
        chi2=chi2,
        dof=dof,
        iterations=iterations,
        assumption=Assumption.LENGTH if beyond_tip else None,
    )


def verdict(
    rig: Rig, x_c: float, x_sigma: float, s_c: float, s_sigma: float
) -> tuple[Outcome, str]:
    """Return the outcome of a contact at distance x_c [m], arc length s_c [m], and the reason."""
    length = rig.free_length
    s_sigma = math.hypot(s_sigma, rig.tolerances.beam_length)
    if s_c > length + THRESHOLDS.beyond_tip_sigmas * s_sigma:
        return (
            Outcome.INVALID,
            f"the contact is at {s_c:.4g} m, beyond the tip at {length:.4g} m",
        )
    if x_sigma > length:
        return Outcome.NOT_IDENTIFIABLE, "the contact can be anywhere on the beam"
    if x_sigma > THRESHOLDS.weak_sigma * length:
        return Outcome.WEAK_CONTACT, ""
    if x_c < THRESHOLDS.x_c_sigmas * x_sigma:
        return Outcome.NOT_IDENTIFIABLE, "the contact is within four sigma of the clamp"
    if s_c > length - 2 * s_sigma:
        return Outcome.TIP_CONTACT, ""
    return Outcome.CONTACT, ""
