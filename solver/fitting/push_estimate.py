"""Convert the fit of a push to the estimate of its last frame, or to a failure outcome."""

import math
from dataclasses import replace
from typing import Final

import numpy as np
from scipy.linalg import block_diag
from scipy.special import chdtri

from solver.core.least_squares import Fit
from solver.core.thresholds import THRESHOLDS
from solver.fitting.frame_values import force_variance_second_order
from solver.fitting.push_joint import PUSH, RADIUS_SIGMA, PushAt
from solver.fitting.verdict import classified_estimate, single_frame
from solver.instrument.arrays import Floats
from solver.instrument.estimate import Assumption, Estimate, FittedParameter, Outcome
from solver.instrument.measurement import Measurement

# The radius is reported only if its sigma is below this share of its prior sigma. Derived: the
# prior then makes the radius smaller by less than 7 %.
MAX_RADIUS_SHARE: Final = 0.25
# Sigma of the contact distance over that of the last frame alone, above which the contact is that
# of the frame. Chosen: a push is never worse with a motor's axis that is known, and thirty times
# worse with one that is known to a centimetre.
MOST_SIGMAS: Final = 2.0
# Friction is reported only if its sigma is below this share of its prior sigma. Chosen.
MAX_FRICTION_SHARE: Final = 0.5


def push_estimate(at: PushAt, last: Measurement, fit: Fit, single: Estimate) -> Estimate:
    """Return the estimate, or the outcome if the frames are inconsistent or insufficient."""
    push, count, chi2 = at.push, len(at.push.frames), fit.chi2
    dof = push.beam.points + 1 - PUSH

    def failure(message: str, assumption: Assumption | None = None) -> Estimate:
        return Estimate(
            Outcome.INVALID,
            message,
            chi2=chi2,
            dof=dof,
            iterations=fit.iterations,
            assumption=assumption,
        )

    if fit.rank_deficient:
        return single_frame(single, f"{count} frames do not determine the push")
    consistency, equations = at.consistency_chi2()
    if consistency > chdtri(equations, THRESHOLDS.false_rejection):
        return single_frame(
            single,
            f"the {count} frames of the push do not fit one object at one place on a linear "
            f"spring: chi^2 of the push is {consistency:.3g} on {equations} degrees of freedom",
        )
    if not fit.converged:
        return single_frame(single, f"the fit of {count} frames did not converge")
    radius_index = push.size - 1
    excess_radius = fit.parameters[radius_index] - last.rig.beam.radius
    if excess_radius < -THRESHOLDS.impossible_sigmas * math.sqrt(
        fit.covariance[radius_index, radius_index]
    ):
        return single_frame(
            single,
            "the contact's motion along the beam fits no object at rest"
            + ("" if push.friction else " without friction"),
        )
    coefficient = fit.parameters[push.size] if push.friction else 0.0
    if (
        coefficient < 0
        and coefficient**2 > THRESHOLDS.impossible_sigmas**2 * fit.covariance[push.size, push.size]
    ):
        return failure("the coefficient of friction would be negative")
    values, covariance = _quantities(at, last, fit)
    row = list(values).index("compliance_m_per_n")
    if values["compliance_m_per_n"] < -THRESHOLDS.impossible_sigmas * math.sqrt(
        covariance[row, row]
    ):
        return failure(
            "the compliance would be negative: the motor turns about another axis than the rig "
            "states, or the beam is not the rig's",
            Assumption.MOTOR_AXIS,
        )
    estimate = classified_estimate(
        last.rig,
        values,
        covariance,
        f"{count} frames",
        chi2=chi2,
        dof=dof,
        iterations=fit.iterations,
    )
    if not estimate.values:
        return estimate
    if estimate.sigma("x_c_m") > MOST_SIGMAS * single.sigma("x_c_m"):
        return _with_contact_of(single, estimate)
    sigmas, first = np.sqrt(np.diag(fit.covariance)), push.base.start
    own = {
        name: FittedParameter(float(fit.parameters[first + i]), float(sigmas[first + i]))
        for name, i in push.beam.own.items()
    }
    return replace(estimate, parameters=own)


def _with_contact_of(single: Estimate, push: Estimate) -> Estimate:
    """Return a single frame's estimate with the values that only its push has.

    The errors of both are taken as independent: those of the push are of the motor's axis.
    """
    assert single.covariance is not None
    assert push.covariance is not None
    names = list(push.values)
    of_push = [name for name in names if name not in single.values]
    rows = [names.index(name) for name in of_push]
    contact = single_frame(single, "the place of the motor's axis is too uncertain for the push")
    return replace(
        contact,
        values={**single.values, **{name: push.values[name] for name in of_push}},
        covariance=block_diag(single.covariance, push.covariance[np.ix_(rows, rows)]),
    )


def _quantities(at: PushAt, last: Measurement, fit: Fit) -> tuple[dict[str, float], Floats]:
    """Compute all values of the last frame and of the push, and their joint covariance."""
    push, shapes = at.push, at.shapes
    side, count, n = last.rig.deflects_towards, len(push.frames), len(fit.parameters)
    x0 = push.size - PUSH
    onset, compliance = float(fit.parameters[x0 + 1]), float(fit.parameters[x0 + 2])
    friction_ratio = float(push.ratio_matrix[-1] @ fit.parameters[push.size :])
    last_shape = push.beam.last_shape(
        last,
        float(fit.parameters[count - 1]),
        float(shapes.places[-1]),
        fit.parameters[push.base],
        friction_ratio,
        # The encoder's reading, corrected by the shapes: onset less the pushing angle.
        onset - side * float(shapes.pushing_angles[-1]),
    )
    # Derivatives of q, place, clamp and beam, friction ratio and motor angle by the fit's
    # parameters.
    by_fit = np.zeros((last_shape.jacobian.shape[1] - 2, n))
    by_fit[0, count - 1], by_fit[1] = 1.0, shapes.d_places[-1]
    by_fit[2:-2, push.base] = np.eye(push.base.stop - push.base.start)
    by_fit[-2, push.size :] = push.ratio_matrix[-1]
    by_fit[-1] = -side * shapes.d_pushing_angles[-1]
    by_fit[-1, x0 + 1] += 1.0
    values = dict(last_shape.values)
    rows = len(values)
    # By the fit's parameters, and the relative errors of EI and of all lengths.
    jacobian = np.zeros((rows + 2, n + 2))
    jacobian[:rows, :n] = last_shape.jacobian[:, :-2] @ by_fit
    jacobian[:rows, n:] = last_shape.jacobian[:, -2:]
    # Shapes determine only compliance times EI; by similarity it grows as a length cubed.
    jacobian[rows, x0 + 2] = 1.0
    jacobian[rows, n:] = -compliance, 3 * compliance
    jacobian[rows + 1, x0 + 1] = 1.0
    values |= {"compliance_m_per_n": compliance, "onset_angle_rad": onset}
    radius_index = push.size - 1
    radius_sigma = math.sqrt(fit.covariance[radius_index, radius_index])
    if radius_sigma < MAX_RADIUS_SHARE * RADIUS_SIGMA * last.rig.beam.length:
        reach = float(fit.parameters[radius_index])
        values["object_radius_m"] = reach - last.rig.beam.radius
        # The contact rolls on the object over a distance that grows with the lengths.
        by_radius = np.append(np.arange(n) == radius_index, [0.0, reach])
        jacobian = np.vstack([jacobian, by_radius])
    if (
        push.friction
        and math.sqrt(fit.covariance[push.size, push.size])
        < MAX_FRICTION_SHARE * push.friction_sigma
    ):
        values["friction"] = float(fit.parameters[push.size])
        jacobian = np.vstack([jacobian, np.arange(n + 2) == push.size])
    input_covariance = np.zeros((n + 2, n + 2))
    input_covariance[:n, :n] = fit.covariance
    input_covariance[[n, n + 1], [n, n + 1]] = last_shape.input_variances
    if compliance > THRESHOLDS.soft_sigmas * math.sqrt(
        float(jacobian[rows] @ input_covariance @ jacobian[rows])
    ):
        values["stiffness_n_per_m"] = 1 / compliance
        jacobian = np.vstack([jacobian, -jacobian[rows] / compliance**2])
    covariance = jacobian @ input_covariance @ jacobian.T
    covariance[:rows, :rows] += last_shape.placement
    force = list(values).index("force_n")
    friction_ratio_sigma = math.sqrt(by_fit[-2] @ input_covariance[:n, :n] @ by_fit[-2])
    covariance[force, force] += force_variance_second_order(
        values["force_n"], friction_ratio, friction_ratio_sigma
    )
    return values, covariance
