"""Fit all frames of a push with the exact beam: position and stiffness of the object.

A push is planar (psi = 0), against one object that is at rest or yields on a linear spring along
the normal of the beam at first contact, as in the paper's Fig. 10. The motor turns the clamp about
the axis that the rig states. Then every frame's shape follows
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
determine the onset; its estimate is that of `exact_fit`, and so is that of a push that does not fit
one object: it moved, slipped, or is a wall, along which the contact runs. Two cases are not
observable in a push: an object that creeps along with the force looks like a softer one, and one
that creeps towards the clamp like a rounder one.

The accuracy is limited by the encoder: a stiff object's compliance appears only in the difference
between the motor's angle and the beam's, so that an encoder of 0.01 degrees leaves 0.09 % of the
beam's own compliance x_c^3 / (3 EI) after seven frames from 3 to 15 degrees, whatever the camera.
"""

from dataclasses import replace
from typing import Final

import numpy as np

from solver.core.thresholds import THRESHOLDS
from solver.fitting.frame_problem import OwnBeamOf
from solver.fitting.push_estimate import push_estimate
from solver.fitting.push_frames import BentFrames, bent_frames
from solver.fitting.push_joint import FRICTION_PRIOR_SIGMA, PUSH, Push
from solver.fitting.sliding import ratio_matrix
from solver.fitting.uniform_estimate import uniform_estimate
from solver.fitting.unknown_friction import with_unknown_friction
from solver.fitting.verdict import single_frame
from solver.instrument.arrays import Floats
from solver.instrument.beam_shape import CLAMP_SHIFT
from solver.instrument.estimate import Estimate, Outcome
from solver.instrument.measurement import Measurement
from solver.instrument.rig import ClampOffset
from solver.methods.exact_fit import exact_fit

# Uncertainty of the object's compliance over the beam's own before the fit. Chosen: friction, which
# the start neglects, increased it by 0.03 to 0.12 on a beam of 12 mm on 240 mm.
_START_SIGMA: Final = 0.02


def push_fit_friction(measurement: Measurement, *, beam: OwnBeamOf | None = None) -> Estimate:
    """Run `push_fit` with Coulomb friction between the beam and the object."""
    return push_fit(measurement, friction=True, beam=beam)


def push_fit(
    measurement: Measurement, friction: bool = False, *, beam: OwnBeamOf | None = None
) -> Estimate:
    """Estimate the last frame's contact, the object's compliance and the onset, with covariance.

    The radius of the object is among the values where the push determines it.

    With `friction`, or where the rig states that objects may have it, also estimate its
    coefficient, which a single frame does not determine. `beam` is that of `exact_fit`.
    """
    unknown_friction = friction and not measurement.rig.shape.ratio_sigma
    rough = _with_friction(measurement) if unknown_friction else measurement
    if unknown_friction and measurement.uniform and beam is None:
        # Not judged: friction bends a beam much as a taper does.
        alone = uniform_estimate(measurement).estimate
        single = with_unknown_friction(alone, measurement, FRICTION_PRIOR_SIGMA)
    else:
        single = exact_fit(rough, beam=beam)
    if not single.values:
        return single
    if measurement.rig.known_psi:
        return single_frame(single, "the push is not in plane C")
    if measurement.motor_angle is None:
        return single_frame(single, "no motor angle is read")
    bent = bent_frames(rough, beam)
    if bent is None or len(bent.frames) < 2:
        return single_frame(single, "no earlier frame shows a bend")
    return _joint_estimate(rough, bent, single)


def _joint_estimate(measurement: Measurement, bent: BentFrames, single: Estimate) -> Estimate:
    """Estimate from all bent frames of a push; `single` is that of the last frame alone."""
    friction_sigma = measurement.rig.shape.ratio_sigma
    no_friction = np.zeros((len(bent.frames), 0))
    offset = _offset(measurement)
    push = Push(
        bent.frames,
        measurement.rig,
        bent.beam,
        no_friction,
        offset=offset.position,
        offset_covariance=offset.covariance,
    )
    if np.ptp(push.motor_angles) < THRESHOLDS.min_turn_sigmas * push.encoder_sigma:
        return single_frame(single, "the motor has not turned")
    start = _start(push, bent)
    if start is None or push.residuals(start) is None:
        return Estimate(Outcome.INVALID, "the frames' shapes do not fit one push")
    if friction_sigma:
        push = _sliding(replace(push, friction_sigma=friction_sigma), bent, start, _START_SIGMA)
        start = np.append(start, np.zeros(push.ratio_matrix.shape[1]))
    fit, at = push.fit(start)
    if friction_sigma and not fit.rank_deficient:
        sigma = 2 * np.sqrt(fit.covariance[push.size - 2, push.size - 2])
        again = _sliding(push, bent, fit.parameters, sigma * _unit_stiffness(push, bent))
        if not np.array_equal(again.ratio_matrix, push.ratio_matrix):
            no_ratios = np.zeros(again.ratio_matrix.shape[1])
            push, start = again, np.append(fit.parameters[: push.size], no_ratios)
            fit, at = push.fit(start)
    if not fit.rank_deficient:
        moved = at.moved_by_offset(fit.covariance)
        fit = replace(fit, covariance=fit.covariance + moved @ moved.T)
    return push_estimate(at, measurement, fit, single)


def _offset(measurement: Measurement) -> ClampOffset:
    """Return the offset of where the beam begins to bend from the motor's axis, in its frame."""
    rig, axes = measurement.rig, measurement.antenna_from_beam[:2, :2]
    shift, sigma = rig.shape.clamp_shift, rig.shape.sigma(CLAMP_SHIFT)
    along = np.array([rig.beam.length, 0.0])
    return ClampOffset(
        axes.T @ rig.clamp_offset.position + shift * along,
        axes.T @ rig.clamp_offset.covariance @ axes + sigma**2 * np.outer(along, along),
    )


def _sliding(push: Push, bent: BentFrames, parameters: Floats, compliance_sigma: float) -> Push:
    """Return the push with the sliding directions of its frames, as of these parameters.

    `compliance_sigma` is the uncertainty of the object's compliance over the beam's own.
    """
    _, onset, compliance, _ = parameters[push.size - PUSH : push.size]
    softest = max(compliance, 0.0) * _unit_stiffness(push, bent) + compliance_sigma
    if push.rig.shape.rigid_objects:
        softest = 0.0
    matrix = ratio_matrix(
        push.rig.deflects_towards * (onset - push.motor_angles),
        [frame.begins for frame in bent.frames],
        push.encoder_sigma,
        slenderness=push.rig.beam.radius / bent.distance,
        softest=softest,
    )
    return replace(push, ratio_matrix=matrix)


def _unit_stiffness(push: Push, bent: BentFrames) -> float:
    """Compute the beam's own stiffness [N/m] against the object."""
    return 3 * push.rig.beam.flexural_rigidity / bent.distance**3


def _with_friction(measurement: Measurement) -> Measurement:
    """Return the measurement and its earlier frames with a rig that states friction."""
    rig = measurement.rig
    rough = replace(rig, shape=replace(rig.shape, friction_sigma=FRICTION_PRIOR_SIGMA))
    earlier = tuple(replace(frame, rig=rough) for frame in measurement.earlier)
    return replace(measurement, rig=rough, earlier=earlier)


def _start(push: Push, bent: BentFrames) -> Floats | None:
    """Compute a start: one contact for all frames, onset by a straight line; None if it fails."""
    beam, side = push.rig.beam, push.rig.deflects_towards
    parameters = np.array([*bent.q, *bent.base, bent.distance, 0.0, 0.0, beam.radius])
    shapes = push.shapes(parameters)
    if shapes is None:
        return None
    # pushing angle = side (onset - motor angle); a spring reduces it by compliance F / x0.
    force = beam.flexural_rigidity * bent.q
    design = np.column_stack([np.full(len(bent.q), side), -force / bent.distance])
    target = shapes.pushing_angles + side * push.motor_angles
    parameters[-PUSH + 1 : -1] = np.linalg.lstsq(design, target, rcond=None)[0]
    return parameters
