"""Estimation of the flexural rigidity EI from a known weight that hangs on the beam.

A weight is a dead load: it keeps its direction while the beam turns under it, so it is not the
frictionless contact of the methods. For a beam clamped level,

    EI theta'' = -(W [s < s_w] + w (L - s)) cos(theta),   theta(0) = 0,   theta'(L) = 0,

with W at arc length s_w and the beam's own weight w a metre (Bisshopp and Drucker 1945 for W at
the end). The beam's shape depends on W / EI and w / EI only. The images at rest and under the
weight are fitted together: they share the clamp's pose and w / EI, and differ in W / EI.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache, partial

import numpy as np
from scipy.integrate import solve_bvp
from scipy.interpolate import CubicHermiteSpline
from scipy.optimize import least_squares

from solver.calibrate.thresholds import LIMITS
from solver.fitting.correlation import correlation_length
from solver.instrument.arrays import Floats
from solver.instrument.errors import InputError
from solver.instrument.measurement import Measurement

# Points with a residual above this many sigmas have less weight.
_ROBUST_SIGMAS = 3.0
# Bounds of the weight's place in the fit, which keep it on the beam: fractions of the length.
_MIN_PLACE, _MAX_PLACE = 1e-3, 0.9999
# Residuals [sigma] where the beam has no shape under such a load.
_NO_SHAPE = 1e6
# Least load W L^2 / EI: it deflects the beam by a millionth of the length, which is invisible.
_MIN_LOAD = 3e-6
_HALVINGS = 20
_NODES = np.linspace(0.0, 1.0, 60)


@dataclass(frozen=True)
class HungWeight:
    """A weight `force` [N] at arc length `at` [m] from the clamp, with their sigmas.

    `level_sigma` [rad] is the one-sigma tilt of the clamp from level.
    """

    force: float
    force_sigma: float
    at: float
    at_sigma: float
    level_sigma: float


@dataclass(frozen=True)
class Rigidity:
    """EI and its sigma [N m^2].

    `at` and `at_sigma` [m]: the fitted place of the weight; `sag` [m]: sag of the tip by the beam's
    own weight; `misfit`: the points' scatter about the fitted beam in units of their sigma, the
    larger of at rest and under the weight.
    """

    value: float
    sigma: float
    at: float
    at_sigma: float
    sag: float
    misfit: float


def flexural_rigidity(
    rest: Sequence[Measurement], loaded: Sequence[Measurement], weight: HungWeight
) -> Rigidity:
    """Estimate EI from the beam at rest and under a weight, in the frame of the beam at rest.

    The weight pulls in the calibration plane, across the beam at rest. Raises InputError where
    the images do not determine EI, or contradict that weight at that place.
    """
    rig = loaded[0].rig
    length = rig.beam.length
    if not (math.isfinite(weight.force) and weight.force > 0):
        raise InputError(f"the weight is {weight.force:g} N, allowed is a finite number above 0")
    if not 0 < weight.at < length:
        raise InputError(
            f"the weight hangs at {1e3 * weight.at:g} mm, allowed is on the beam, "
            f"above 0 and below {1e3 * length:g} mm"
        )
    groups = [_pool(rest, "at rest"), _pool(loaded, "under the weight")]
    base = loaded[0].base_covariance
    # Sigmas of the priors: clamp along the beam, place of the weight, level, scale.
    prior_sigmas = np.array([math.sqrt(base[0, 0]), weight.at_sigma, weight.level_sigma])
    prior_sigmas = np.maximum(np.append(prior_sigmas, loaded[0].scale_sigma), 1e-9)
    start = _linear_start(groups, weight.at, length)
    # Loads are in units of the linear estimate, which does not depend on the rig's EI.
    unit = abs(start[0])
    start[:2] /= [unit, unit / length]
    start[2] /= length

    def residuals(p: Floats, inflation: Floats) -> Floats:
        load, self_weight, y, tilt = p[0] * unit, p[1] * unit / length, p[2] * length, p[3]
        shift_x, shift_place, level, scale = p[4:] * prior_sigmas
        residuals_by_group = []
        for (points, sigmas), applied, factor in zip(groups, (0.0, load), inflation, strict=True):
            # No shape under a large trial load: the fit rejects the step.
            at = weight.at + shift_place
            curve = hung_beam(applied, self_weight, at if applied else 0.5 * length, level, length)
            if curve is None:
                residuals_by_group.append(np.full(len(points), _NO_SHAPE))
                continue
            rotation = np.array(
                [[math.cos(tilt), -math.sin(tilt)], [math.sin(tilt), math.cos(tilt)]]
            )
            at_clamp = (points / (1 + scale) - [shift_x, y]) @ rotation
            residuals_by_group.append(_distances(curve, at_clamp, sigmas @ rotation) / factor)
        return np.concatenate([*residuals_by_group, p[4:]])

    # Of all parameters, only the weight's place is bounded: by the beam's ends.
    low, high = np.full(8, -np.inf), np.full(8, np.inf)
    low[5], high[5] = (np.array([_MIN_PLACE, _MAX_PLACE]) * length - weight.at) / prior_sigmas[1]
    start[5] = np.clip(0.0, low[5], high[5])
    sizes = [len(points) for points, _ in groups]
    inflation = np.ones(2)
    # The first pass estimates how far errors exceed their sigmas, and their correlation length.
    for _ in range(2):
        fit = least_squares(
            residuals,
            start,
            bounds=(low, high),
            loss=partial(_loss, sum(sizes)),
            f_scale=_ROBUST_SIGMAS,
            diff_step=1e-4,
            args=(inflation,),
        )
        start = fit.x
        unweighted = residuals(fit.x, np.ones(2))
        residuals_by_group = (unweighted[: sizes[0]], unweighted[sizes[0] : sum(sizes)])
        scatter = [1.4826 * float(np.median(np.abs(group))) for group in residuals_by_group]
        inflation = np.array(
            [
                max(sigma_ratio, 1.0) * math.sqrt(correlation_length(group))
                for sigma_ratio, group in zip(scatter, residuals_by_group, strict=True)
            ]
        )
    covariance = np.linalg.pinv(fit.jac.T @ fit.jac, hermitian=True)
    ratio, ratio_sigma = abs(float(fit.x[0])), math.sqrt(covariance[0, 0])
    if not np.abs(unweighted).max() < _NO_SHAPE:
        raise InputError(
            f"no beam of {1e3 * length:g} mm under a weight fits the images: is its slope above "
            f"{math.degrees(LIMITS.max_slope):.0f} deg, or does another force bend it?"
        )
    if not fit.success or not ratio > LIMITS.min_load_sigmas * ratio_sigma:
        raise InputError(
            "the weight bends the beam too little to determine EI: use a heavier one or a larger "
            "distance from the clamp"
        )
    _check_consistency(fit.x[5:7], prior_sigmas[1:3], max(scatter))
    value = weight.force / (ratio * unit)
    sigma = value * math.hypot(ratio_sigma / ratio, weight.force_sigma / weight.force)
    rest_shape = hung_beam(0.0, fit.x[1] * unit / length, weight.at, 0.0, length)
    assert rest_shape is not None
    return Rigidity(
        value=value,
        sigma=sigma,
        at=weight.at + float(fit.x[5] * prior_sigmas[1]),
        at_sigma=math.sqrt(covariance[5, 5]) * float(prior_sigmas[1]),
        sag=float(rest_shape(rest_shape.x[-1])),
        misfit=max(scatter),
    )


def _loss(points: int, z: Floats) -> Floats:
    """Compute soft L1 of the first `points` squared residuals, and plain squares of the priors.

    A robust prior would lose its weight as soon as the images disagree with it.
    """
    root = np.sqrt(1 + z)
    robust = np.array([2 * (root - 1), 1 / root, -0.5 / root**3])
    robust[:, points:] = [z[points:], np.ones(len(z) - points), np.zeros(len(z) - points)]
    return robust


def _check_consistency(deviations: Floats, sigmas: Floats, misfit: float) -> None:
    """Reject a weight, level or shape that contradicts the images. Raises InputError.

    `deviations` (2,) are the deviations of the weight's place and of the clamp's level, in units of
    `sigmas` (2,), [m] and [rad]; `misfit` is the points' scatter about the fitted shape.
    """
    place, level = deviations * sigmas
    if misfit > LIMITS.max_weight_misfit:
        raise InputError(
            f"the points deviate by {misfit:.1f} sigma from the fitted beam, allowed is "
            f"{LIMITS.max_weight_misfit:g}: only the weight may bend the beam, and nothing "
            "may touch it"
        )
    largest = int(np.argmax(np.abs(deviations)))
    if abs(deviations[largest]) <= LIMITS.max_weight_deviation:
        return
    if largest == 0:
        raise InputError(
            f"the fitted weight is {1e3 * abs(place):.2g} mm nearer to the "
            f"{'tip' if place > 0 else 'clamp'} than stated ({abs(deviations[0]):.0f} sigma): "
            "check its stated place, and that no other force bends the beam"
        )
    raise InputError(
        f"the fitted clamp is {math.degrees(abs(level)):.2g} deg from level "
        f"({abs(deviations[1]):.0f} sigma): the weight must pull across the beam, "
        "in the board's plane"
    )


# Cached, for half of the fit's parameters move the beam without bending it.
@lru_cache(maxsize=64)
def hung_beam(
    load: float, own: float, at: float, level: float, length: float
) -> CubicHermiteSpline | None:
    """Compute y(x) [m] of a clamped beam under `load` = W / EI [1/m^2] at arc length `at` [m].

    `own` = w / EI [1/m^3] is its own weight's. The clamp points down by `level` [rad]. Accurate
    to 1e-7 of the length. Return None where the beam turns too steeply or no shape is found.
    """
    spans = np.array([at, length - at])[:, None]

    def derivatives(t: Floats, state: Floats) -> Floats:
        theta, moment = state[0:2], state[2:4]
        load_ahead = own * np.vstack([length - at * t, (length - at) * (1 - t)])
        load_ahead[0] += load
        rates = [moment, -load_ahead * np.cos(theta + level), np.cos(theta), np.sin(theta)]
        return np.vstack([spans * rate for rate in rates])

    def boundary(start: Floats, end: Floats) -> Floats:
        # Clamped at the origin, continuous where the weight hangs, free at the tip.
        jumps = end[0::2] - start[1::2]
        return np.array([start[0], start[4], start[6], end[3], *jumps])

    solution = solve_bvp(derivatives, boundary, np.linspace(0, 1, 11), np.zeros((8, 11)), tol=1e-6)
    state = solution.sol(_NODES)
    theta = np.concatenate([state[0], state[1][1:]])
    if not solution.success or np.abs(theta).max() > LIMITS.max_slope:
        return None
    x, y = (np.concatenate([part[0], part[1][1:]]) for part in (state[4:6], state[6:8]))
    return CubicHermiteSpline(x, y, np.tan(theta))


def _pool(measurements: Sequence[Measurement], when: str) -> tuple[Floats, Floats]:
    """Pool the points of several images and their sigma vectors, in order along the beam."""
    points = np.vstack([measurement.points for measurement in measurements])
    sigmas = np.vstack([measurement.sigma_vectors for measurement in measurements])
    if len(points) < LIMITS.min_weight_points:
        raise InputError(
            f"the images of the beam {when} show {len(points)} points, "
            f"needed are {LIMITS.min_weight_points}"
        )
    order = np.argsort(points[:, 0], kind="stable")
    return points[order], sigmas[order]


def _linear_start(groups: Sequence[tuple[Floats, Floats]], at: float, length: float) -> Floats:
    """Estimate the fit's start (8,) by linear theory, eqs. (9) and (10).

    Its first values are load and own weight [1/m^2, 1/m^3], offset [m] and tilt [rad] at rest. They
    are fitted jointly to the beam at rest and under the weight, with a clamp that is offset and
    tilted. The loads are halved until the beam has a shape.
    """
    design, y = [], []
    for (points, _), loaded in zip(groups, (False, True), strict=True):
        x = points[:, 0]
        inner, outer = (3 * at - x) * x**2 / 6, (3 * x - at) * at**2 / 6
        bent = np.where(x < at, inner, outer) * loaded
        sagged = x**2 * (6 * length**2 - 4 * length * x + x**2) / 24
        design.append(np.column_stack([bent, sagged, np.ones_like(x), x]))
        y.append(points[:, 1])
    scale = np.array([length**3, length**4, 1.0, length])
    start = np.linalg.lstsq(np.vstack(design) / scale, np.concatenate(y), rcond=None)[0] / scale
    start[0] = math.copysign(max(abs(start[0]), _MIN_LOAD / length**2), start[0])
    for _ in range(_HALVINGS):
        if hung_beam(start[0], start[1], at, 0.0, length) is not None:
            break
        start[:2] /= 2
    return np.concatenate([start, np.zeros(4)])


def _distances(curve: CubicHermiteSpline, points: Floats, sigmas: Floats) -> Floats:
    """Compute distances (n,) of points from the curve along its normal, over their sigmas."""
    slope = curve(points[:, 0], 1)
    normal = np.column_stack([-slope, np.ones_like(slope)])
    residuals = points[:, 1] - curve(points[:, 0])
    return np.asarray(residuals / np.abs((sigmas * normal).sum(axis=1)))
