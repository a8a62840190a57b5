"""One frame by itself, of a beam that its object may drag along.

A single image hardly tells a force that leans off the beam's normal from another one elsewhere.
What it says without friction stands; what a grip as usual for dry things would change of it, to
first order, is added to its covariance.
"""

import numpy as np

from solver.fitting.problem import problem_of, settled, started, without
from solver.fitting.push_frame import Frame
from solver.fitting.push_joint import DRY
from solver.fitting.residuals import DX, DY, LEVER, TILT, Q
from solver.fitting.values import SHAPE, shape_quantities
from solver.fitting.verdict import judged
from solver.instrument.estimate import Estimate
from solver.instrument.measurement import Measurement


def with_unknown_grip(alone: Estimate, measurement: Measurement) -> Estimate:
    """The answer `alone` of `exact_fit` in plane C, as uncertain as friction makes it."""
    problem = problem_of(measurement, with_tips=False)
    start = started(problem, 0.0)
    fit = None if start is None else settled(problem, start, psi_free=False)
    if fit is None or alone.covariance is None:
        return alone
    length = measurement.rig.beam.length
    p = fit.p[[Q, LEVER, DX, DY, TILT]] * [length**-2, length, length, length, 1.0]
    frame = Frame(0.0, without(problem, fit.kept), fit.widening)
    rows = frame.points(p[:2], p[2:], length, grip=0.0)
    if rows is None:
        return alone
    known = np.linalg.inv(np.linalg.cholesky(measurement.base_covariance))
    by_p = np.vstack([rows[:, :5], np.hstack([np.zeros((3, 2)), known])])
    by_grip = np.append(rows[:, 5], np.zeros(3))
    moved, *_ = np.linalg.lstsq(by_p, -by_grip)
    column = {name: i for i, name in enumerate(SHAPE)}
    shape = np.zeros(len(SHAPE))
    in_shape = [column[name] for name in ("q", "lever", "dx", "dy", "tilt")]
    shape[in_shape] = p
    shape[column["motor_angle"]] = measurement.motor_angle or 0.0
    _, by_shape, _ = shape_quantities(measurement, shape, clamp_fitted=True, grip_fitted=True)
    change = DRY * (by_shape[:, in_shape] @ moved + by_shape[:, column["grip"]])
    return judged(
        measurement.rig,
        alone.values,
        alone.covariance + np.outer(change, change),
        alone.message,
        chi2=alone.chi2,
        dof=alone.dof,
        iterations=alone.iterations,
    )
