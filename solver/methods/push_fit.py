"""Fit all frames of a push with the exact beam: position and stiffness of the object.

A push is planar (psi = 0), against one object that is at rest or yields on a linear spring along
the normal of the beam at first contact, as in the paper's Fig. 10. Then every frame's shape follows
from the motor angle and four parameters: the contact distance at rest, the motor angle of first
contact, the object's compliance 1/k_s, and its radius. On a round object the contact rolls, which
determines the radius where it is large enough; it is 0 for an edge, and covers 0 if its sigma does.
The fit estimates the compliance, not the
stiffness: the compliance is regular for a rigid object (Fig. 11, and (30), (31) with tan) and may
have either sign, so that its interval covers zero if the object is rigid.

Friction is optional, because it increases the uncertainty where there is none: Coulomb's
coefficient is then a fifth parameter. One image hardly distinguishes a force inclined against the
beam's normal from a normal force at another place; frames with a common object position do. The
sliding direction, on or back, follows from the motor's motion; where the contact may be held
instead, a frame has a friction ratio of its own.

The method is causal: a frame is estimated from itself and those before it. A single frame does not
determine the onset; its estimate is that of `exact_fit`. Frames that do not fit one object are an
outcome: the object moved, slipped, or the contact is of another kind. Two cases are not observable
in a push: an object that creeps along with the force looks like a softer one, and one that creeps
towards the clamp like a rounder one.

The accuracy is limited by the encoder: a stiff object's compliance appears only in the difference
between the motor's angle and the beam's, so that an encoder of 0.01 degrees leaves 0.09 % of the
beam's own compliance x_c^3 / (3 EI) after seven frames from 3 to 15 degrees, whatever the camera.
"""

import math
from dataclasses import replace
from typing import Final

import numpy as np
from scipy.stats import chi2 as distribution

from solver.beam_models.linear import unit_deflection
from solver.fitting.fit import fit_from, start_of
from solver.fitting.fit_estimate import refusal_of
from solver.fitting.gauss_newton import Fit, gauss_newton
from solver.fitting.problem import problem_of, without
from solver.fitting.push_frame import PushFrame
from solver.fitting.push_joint import BASE, DRY, PUSH, RADIUS_SIGMA, Push
from solver.fitting.residuals import LEVER
from solver.fitting.sliding import grip_matrix
from solver.fitting.thresholds import LIMITS
from solver.fitting.unknown_grip import curved_by_grip, with_unknown_grip
from solver.fitting.values import SHAPE, shape_quantities
from solver.fitting.verdict import classified_estimate
from solver.instrument.arrays import Floats
from solver.instrument.estimate import Estimate, Outcome
from solver.instrument.measurement import Measurement
from solver.methods.exact_fit import exact_fit

# The radius is reported only if its sigma is below this share of its prior sigma. Derived: the
# prior then makes the radius smaller by less than 7 %.
MAX_RADIUS_SHARE: Final = 0.25
# Friction is reported only if its sigma is below this, half of its prior sigma.
MAX_FRICTION_SIGMA: Final = DRY / 2


def push_fit_friction(measurement: Measurement) -> Estimate:
    """Run `push_fit` with Coulomb friction between the beam and the object."""
    return push_fit(measurement, friction=True)


def push_fit(measurement: Measurement, friction: bool = False) -> Estimate:
    """Estimate the last frame's contact, the object's compliance and the onset, with covariance.

    The radius of the object is among the values where the push determines it.

    With `friction` also estimate its coefficient, which a single frame does not determine.
    """
    single = exact_fit(measurement)
    if not single.values:
        return single
    if friction:
        single = with_unknown_grip(single, measurement)
    if measurement.rig.known_psi:
        return _single_frame(single, "the push is not in plane C")
    if measurement.motor_angle is None:
        return _single_frame(single, "no motor angle is read")
    frames, lever = _bent_frames(measurement)
    no_grip = np.zeros((len(frames), 0))
    push = Push(tuple(frames), measurement.rig, measurement.base_covariance, no_grip)
    if len(frames) < 2:
        return _single_frame(single, "no earlier frame shows a bend")
    if np.ptp(push.motor_angles) < LIMITS.min_turn_sigmas * push.encoder_sigma:
        return _single_frame(single, "the motor has not turned")
    start = _start(push, lever)
    if start is None or push.residuals(start) is None:
        return Estimate(Outcome.INVALID, "the frames' shapes do not fit one push")
    if friction:
        pushing_angles = push.rig.deflects_towards * (start[-PUSH + 1] - push.motor_angles)
        begins = [frame.begins for frame in frames]
        slenderness = push.rig.beam.radius / lever
        matrix = grip_matrix(pushing_angles, begins, push.encoder_sigma, slenderness)
        push = replace(push, grip_matrix=matrix)
        start = np.append(start, np.zeros(push.grip_matrix.shape[1]))
    fit = gauss_newton(push.residuals, start)
    if not fit.rank_deficient:
        moved = push.moved_by_shared_errors(fit)
        fit = replace(fit, covariance=fit.covariance + moved @ moved.T)
    return _estimate(push, measurement, fit, single)


def _single_frame(estimate: Estimate, reason: str) -> Estimate:
    """Return a single frame's estimate, with the reason."""
    message = "; ".join(
        part for part in (f"from this frame alone: {reason}", estimate.message) if part
    )
    return replace(estimate, message=message)


def _bent_frames(measurement: Measurement) -> tuple[list[PushFrame], float]:
    """Return the frames with contact and a motor angle, without outliers, and the best lever [m].

    Each frame is fitted by itself first, which gives the outliers, the variance inflation of the
    other points, and the contact.
    """
    frames, best, lever, begins = [], math.inf, 0.0, True
    for frame in (*measurement.earlier, measurement):
        # As in `exact_fit`, without tips: a detected tip may be an occluder's edge.
        problem = problem_of(frame, with_tips=False)
        start = start_of(problem, 0.0) if problem.points else None
        fit = None if start is None else fit_from(problem, start, psi_free=False)
        refusal = refusal_of(frame, problem, fit)
        if refusal is not None and refusal.outcome is Outcome.NO_CONTACT:
            begins = True
        if fit is None or frame.motor_angle is None or refusal is not None:
            continue
        inliers = problem if fit.kept.all() else without(problem, fit.kept)
        frames.append(PushFrame(frame.motor_angle, inliers, fit.variance_inflation, begins))
        begins = False
        if fit.covariance[LEVER, LEVER] < best:
            best, lever = fit.covariance[LEVER, LEVER], fit.p[LEVER]
    return frames, float(lever) * measurement.rig.beam.length


def _start(push: Push, lever: float) -> Floats | None:
    """Compute a start: one contact for all frames, onset by a straight line; None if it fails."""
    beam, side = push.rig.beam, push.rig.deflects_towards
    bends = []
    for frame in push.frames:
        x, y = frame.problem.arrays[0][:2] * beam.length
        unit = unit_deflection(x, lever)
        q = 6 * float(unit @ y) / float(unit @ unit)
        # Inside the model's domain, however steep the linear shape is.
        bends.append(min(max(q, 1e-9), 1.6 / max(lever - x.min(), lever) ** 2))
    parameters = np.array([*bends, *[0.0] * BASE, lever, 0.0, 0.0, beam.radius])
    shapes = push.shapes(parameters)
    if shapes is None:
        return None
    # pushing angle = side (onset - motor angle); a spring reduces it by compliance F / x0.
    force = beam.flexural_rigidity * np.array(bends)
    design = np.column_stack([np.full(len(bends), side), -force / lever])
    target = shapes.pushing_angles + side * push.motor_angles
    parameters[-PUSH + 1 : -1] = np.linalg.lstsq(design, target, rcond=None)[0]
    return parameters


def _estimate(push: Push, last: Measurement, fit: Fit, single: Estimate) -> Estimate:
    """Return the estimate, or the outcome if the frames are inconsistent or insufficient."""
    count, chi2 = len(push.frames), fit.chi2
    dof = sum(frame.problem.points for frame in push.frames) + 1 - PUSH

    def failure(outcome: Outcome, message: str = "") -> Estimate:
        return Estimate(outcome, message, chi2=chi2, dof=dof, iterations=fit.iterations)

    if fit.rank_deficient:
        return _single_frame(single, f"{count} frames do not determine the push")
    consistency, equations = push.consistency_chi2(fit.parameters)
    if consistency > distribution.isf(LIMITS.false_rejection, equations):
        return failure(
            Outcome.INVALID,
            f"the {count} frames of the push do not fit one object at one place on a linear "
            f"spring: chi^2 of the push is {consistency:.3g} on {equations} degrees of freedom",
        )
    if not fit.converged:
        return _single_frame(single, f"the fit of {count} frames did not converge")
    radius_index = push.size - 1
    excess_radius = fit.parameters[radius_index] - last.rig.beam.radius
    if excess_radius < -LIMITS.impossible_sigmas * math.sqrt(
        fit.covariance[radius_index, radius_index]
    ):
        return failure(
            Outcome.INVALID,
            "the contact's motion along the beam fits no object at rest"
            + ("" if push.friction else " without friction"),
        )
    coefficient = fit.parameters[push.size] if push.friction else 0.0
    if (
        coefficient < 0
        and coefficient**2 > LIMITS.impossible_sigmas**2 * fit.covariance[push.size, push.size]
    ):
        return failure(Outcome.INVALID, "the coefficient of friction would be negative")
    values, covariance = _quantities(push, last, fit)
    row = list(values).index("compliance_m_per_n")
    if values["compliance_m_per_n"] < -LIMITS.impossible_sigmas * math.sqrt(covariance[row, row]):
        return failure(
            Outcome.INVALID,
            "the compliance would be negative: the motor turns about another axis than the "
            "clamp's, or the beam is not the rig's",
        )
    return classified_estimate(
        last.rig,
        values,
        covariance,
        f"{count} frames",
        chi2=chi2,
        dof=dof,
        iterations=fit.iterations,
    )


def _quantities(push: Push, last: Measurement, fit: Fit) -> tuple[dict[str, float], Floats]:
    """Compute all values of the last frame and of the push, and their joint covariance."""
    tolerances, side = last.rig.tolerances, last.rig.deflects_towards
    rigidity = last.rig.beam.flexural_rigidity
    count, n, push_index = len(push.frames), len(fit.parameters), push.size - PUSH
    onset, compliance = float(fit.parameters[push_index + 1]), float(fit.parameters[push_index + 2])
    shapes = push.shapes(fit.parameters)
    assert shapes is not None
    column = {name: i for i, name in enumerate(SHAPE)}
    # The last frame's shape, and its derivative by the fit's parameters.
    base_rows = [column[name] for name in ("dx", "dy", "tilt")]
    shape, by_fit = np.zeros(len(SHAPE)), np.zeros((len(SHAPE), n))
    shape[column["q"]], by_fit[column["q"], count - 1] = fit.parameters[count - 1], 1.0
    shape[column["lever"]], by_fit[column["lever"]] = shapes.levers[-1], shapes.d_levers[-1]
    shape[base_rows], by_fit[base_rows, count:push_index] = (
        fit.parameters[count:push_index],
        np.eye(BASE),
    )
    shape[column["grip"]] = push.grip_matrix[-1] @ fit.parameters[push.size :]
    by_fit[column["grip"], push.size :] = push.grip_matrix[-1]
    # The encoder's reading, corrected by the shapes: onset less the pushing angle.
    shape[column["motor_angle"]] = onset - side * shapes.pushing_angles[-1]
    by_fit[column["motor_angle"]] = -side * shapes.d_pushing_angles[-1]
    by_fit[column["motor_angle"], push_index + 1] += 1.0
    values, by_shape, placement = shape_quantities(
        last, shape, clamp_fitted=True, grip_fitted=push.friction
    )
    rows = len(values)
    # By the fit's parameters, and the relative errors of EI and of all lengths.
    jacobian = np.zeros((rows + 2, n + 2))
    jacobian[:rows, :n] = by_shape @ by_fit
    jacobian[:rows, n:] = by_shape[:, [column["rigidity"], column["scale"]]]
    # Shapes determine only compliance times EI; by similarity it grows as a length cubed.
    jacobian[rows, push_index + 2] = 1.0
    jacobian[rows, n:] = -compliance, 3 * compliance
    jacobian[rows + 1, push_index + 1] = 1.0
    values |= {"compliance_m_per_n": compliance, "onset_angle_rad": onset}
    radius_index = push.size - 1
    radius_sigma = math.sqrt(fit.covariance[radius_index, radius_index])
    if radius_sigma < MAX_RADIUS_SHARE * RADIUS_SIGMA * last.rig.beam.length:
        reach = float(fit.parameters[radius_index])
        values["object_radius_m"] = reach - last.rig.beam.radius
        # The contact rolls on the object over a distance that grows with the lengths.
        by_radius = np.append(np.arange(n) == radius_index, [0.0, reach])
        jacobian = np.vstack([jacobian, by_radius])
    if push.friction and math.sqrt(fit.covariance[push.size, push.size]) < MAX_FRICTION_SIGMA:
        values["friction"] = float(fit.parameters[push.size])
        jacobian = np.vstack([jacobian, np.arange(n + 2) == push.size])
    input_covariance = np.zeros((n + 2, n + 2))
    input_covariance[:n, :n] = fit.covariance
    input_covariance[n, n] = (tolerances.flexural_rigidity / rigidity) ** 2
    input_covariance[n + 1, n + 1] = last.scale_sigma**2
    if compliance > LIMITS.soft_sigmas * math.sqrt(
        float(jacobian[rows] @ input_covariance @ jacobian[rows])
    ):
        values["stiffness_n_per_m"] = 1 / compliance
        jacobian = np.vstack([jacobian, -jacobian[rows] / compliance**2])
    covariance = jacobian @ input_covariance @ jacobian.T
    covariance[:rows, :rows] += placement
    force = list(values).index("force_n")
    grip_sigma = math.sqrt(
        by_fit[column["grip"]] @ input_covariance[:n, :n] @ by_fit[column["grip"]]
    )
    covariance[force, force] += curved_by_grip(values["force_n"], shape[column["grip"]], grip_sigma)
    return values, covariance
