"""Add the uncertainty due to unknown friction to an estimate, also to that of a single frame.

A single image hardly distinguishes a force inclined against the beam's normal from a normal force
at another place. The estimate without friction is unchanged; its first-order change by a friction
ratio typical of dry friction is added to its covariance.
"""

import numpy as np

from solver.fitting.push_joint import FRICTION_PRIOR_SIGMA
from solver.fitting.push_uniform import UniformPoints
from solver.fitting.values import SHAPE, shape_quantities
from solver.fitting.verdict import classified_estimate
from solver.instrument.estimate import Estimate
from solver.instrument.measurement import Measurement
from solver.planes.plane_d import known_plane
from solver.uniform.fit import fit_from, start_of
from solver.uniform.problem import problem_of, without
from solver.uniform.residuals import DX, DY, LEVER, TILT, Q


def force_variance_second_order(force: float, friction_ratio: float, sigma: float) -> float:
    """Compute the second-order variance [N^2] of the force's magnitude due to friction.

    `friction_ratio` is the friction ratio. The magnitude is the component across the beam times
    sqrt(1 + friction ratio^2), whose slope is zero at zero friction ratio. The result is the mean
    square of the second-order term, for a normally distributed friction ratio with this `sigma`.
    """
    return 3 * (force * sigma**2 / (1 + friction_ratio**2) ** 2 / 2) ** 2


def with_unknown_friction(alone: Estimate, measurement: Measurement) -> Estimate:
    """Add the uncertainty due to unknown friction to the `uniform_estimate` `alone`."""
    plane = known_plane(measurement)
    if isinstance(plane, Estimate):
        return plane
    planar, psi = plane
    problem = problem_of(planar, with_tip=False)
    start = start_of(problem, 0.0)
    if start is None or alone.covariance is None:
        return alone
    fit = fit_from(problem, start, psi_free=False)
    length = measurement.rig.beam.length
    p = fit.p[[Q, LEVER, DX, DY, TILT]] * [length**-2, length, length, length, 1.0]
    points = UniformPoints(without(problem, fit.kept), fit.variance_inflation)
    rows = points.rows(p[:2], p[2:], length, friction_ratio=0.0)
    if rows is None:
        return alone
    base_rows = np.linalg.inv(np.linalg.cholesky(planar.base_covariance))
    by_p = np.vstack([rows[:, :5], np.hstack([np.zeros((3, 2)), base_rows])])
    by_friction = np.append(rows[:, 5], np.zeros(3))
    scale = np.maximum(np.linalg.norm(by_p, axis=0), 1e-300)  # units do not affect the rank
    response = np.linalg.lstsq(by_p / scale, -by_friction)[0] / scale
    column = {name: i for i, name in enumerate(SHAPE)}
    shape = np.zeros(len(SHAPE))
    columns = [column[name] for name in ("q", "lever", "dx", "dy", "tilt")]
    shape[columns], shape[column["psi"]] = p, psi
    shape[column["motor_angle"]] = measurement.motor_angle or 0.0
    values, by_shape, _ = shape_quantities(
        measurement, shape, clamp_fitted=True, friction_fitted=True
    )
    change = FRICTION_PRIOR_SIGMA * (
        by_shape[:, columns] @ response + by_shape[:, column["friction_ratio"]]
    )
    covariance = alone.covariance + np.outer(change, change)
    force = list(values).index("force_n")
    covariance[force, force] += force_variance_second_order(
        values["force_n"], 0.0, FRICTION_PRIOR_SIGMA
    )
    return classified_estimate(
        measurement.rig,
        alone.values,
        covariance,
        alone.message,
        chi2=alone.chi2,
        dof=alone.dof,
        iterations=alone.iterations,
    )
