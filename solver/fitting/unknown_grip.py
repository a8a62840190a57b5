"""Add the uncertainty due to unknown friction to an estimate, also to that of a single frame.

A single image hardly distinguishes a force inclined against the beam's normal from a normal force
at another place. The estimate without friction is kept; its change by a grip typical of dry
friction, to first order, is added to its covariance.
"""

import numpy as np

from solver.fitting.fit import fit_from, start_of
from solver.fitting.problem import problem_of, without
from solver.fitting.push_frame import PushFrame
from solver.fitting.push_joint import DRY
from solver.fitting.residuals import DX, DY, LEVER, TILT, Q
from solver.fitting.values import SHAPE, shape_quantities
from solver.fitting.verdict import judged
from solver.instrument.estimate import Estimate
from solver.instrument.measurement import Measurement
from solver.planes.plane_d import known_plane


def curved_by_grip(force: float, grip: float, sigma: float) -> float:
    """Compute the variance [N^2] of a force's magnitude that its slope by the grip leaves out.

    The magnitude is the component across the beam times sqrt(1 + grip^2), whose slope is zero at
    zero grip. The result is the mean square of the second-order term, for a normally distributed
    grip.
    """
    return 3 * (force * sigma**2 / (1 + grip**2) ** 2 / 2) ** 2


def with_unknown_grip(alone: Estimate, measurement: Measurement) -> Estimate:
    """Add the uncertainty due to unknown friction to the estimate `alone` of `exact_fit`."""
    found = known_plane(measurement)
    if isinstance(found, Estimate):
        return found
    planar, psi = found
    problem = problem_of(planar, with_tips=False)
    start = start_of(problem, 0.0)
    if start is None or alone.covariance is None:
        return alone
    fit = fit_from(problem, start, psi_free=False)
    length = measurement.rig.beam.length
    p = fit.p[[Q, LEVER, DX, DY, TILT]] * [length**-2, length, length, length, 1.0]
    frame = PushFrame(0.0, without(problem, fit.kept), fit.variance_inflation)
    rows = frame.points(p[:2], p[2:], length, grip=0.0)
    if rows is None:
        return alone
    known = np.linalg.inv(np.linalg.cholesky(planar.base_covariance))
    by_p = np.vstack([rows[:, :5], np.hstack([np.zeros((3, 2)), known])])
    by_grip = np.append(rows[:, 5], np.zeros(3))
    scale = np.maximum(np.linalg.norm(by_p, axis=0), 1e-300)  # units do not affect the rank
    moved = np.linalg.lstsq(by_p / scale, -by_grip)[0] / scale
    column = {name: i for i, name in enumerate(SHAPE)}
    shape = np.zeros(len(SHAPE))
    in_shape = [column[name] for name in ("q", "lever", "dx", "dy", "tilt")]
    shape[in_shape], shape[column["psi"]] = p, psi
    shape[column["motor_angle"]] = measurement.motor_angle or 0.0
    values, by_shape, _ = shape_quantities(measurement, shape, clamp_fitted=True, grip_fitted=True)
    change = DRY * (by_shape[:, in_shape] @ moved + by_shape[:, column["grip"]])
    covariance = alone.covariance + np.outer(change, change)
    force = list(values).index("force_n")
    covariance[force, force] += curved_by_grip(values["force_n"], 0.0, DRY)
    return judged(
        measurement.rig,
        alone.values,
        covariance,
        alone.message,
        chi2=alone.chi2,
        dof=alone.dof,
        iterations=alone.iterations,
    )
