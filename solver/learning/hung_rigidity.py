"""Estimation of the flexural rigidity EI from a known weight that hangs on the beam.

A weight is a dead load: it keeps its direction while the beam turns under it, so it is not the
frictionless contact of the methods. For a beam clamped level,

    M' = -(W [s < s_w] + w V(s)) cos(theta),   theta' = M / (EI b(s)^4),   theta(0) = c M(0),

with M(L) = 0, W at arc length s_w, the width b over that at the clamp, and the clamp's softness c.
EI and the beam's own weight w a metre are those at the clamp; V(s) is the integral of b^2 from s to
L (Bisshopp and Drucker 1945 for a uniform beam with W at the end). The beam's shape depends on
W / EI and w / EI only. The images at rest and under the weight are fitted together: they share the
clamp's pose and w / EI, and differ in W / EI. What the rig states of the beam's taper, its clamp
and the plane in which it bends are parameters with their priors.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.polynomial import Legendre, Polynomial
from scipy.integrate import solve_bvp
from scipy.interpolate import CubicHermiteSpline
from scipy.optimize import least_squares

from solver.beams.linear import unit_deflection
from solver.beams.stretch import LEAST_WIDTH, least_width
from solver.core.correlation import correlation_length
from solver.fitting.frame_problem import in_beam_frame
from solver.instrument.arrays import Floats
from solver.instrument.beam_shape import FIRST_WIDTH
from solver.instrument.errors import InputError
from solver.instrument.measurement import Measurement
from solver.instrument.medians import SIGMA_OVER_MAD
from solver.instrument.transforms import turn_about_z
from solver.planes.plane_d import unproject

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
# Parameters of the fit before those of the beam's shape.
_OWN = 8
# Fewest points of a beam under a hung weight. Chosen.
_MIN_POINTS: Final = 20
# Largest slope [rad]. Chosen: on a steeper beam, x no longer determines the place, and the weight
# slides.
_MAX_SLOPE: Final = math.radians(60)
# Least load of the weight over its sigma. Chosen: it determines EI to 5 %.
_MIN_LOAD_SIGMAS: Final = 20.0
# Deviation of the weight's place, and of the clamp's level, from those stated, in sigmas. Chosen.
_MAX_DEVIATION: Final = 4.0
# Scatter of the points about the fitted beam, in sigmas. Chosen.
_MAX_MISFIT: Final = 3.0


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
    """EI at the clamp and its sigma [N m^2].

    `known_shape_sigma` is the sigma that a beam and a clamp of known shape would have. `at` and
    `at_sigma` [m]: the fitted place of the weight; `sag` [m]: sag of the tip by the beam's own
    weight; `misfit`: the points' scatter about the fitted beam in units of their sigma, the larger
    of at rest and under the weight.
    """

    value: float
    sigma: float
    known_shape_sigma: float
    at: float
    at_sigma: float
    sag: float
    misfit: float


def flexural_rigidity(
    rest: Sequence[Measurement], loaded: Sequence[Measurement], weight: HungWeight
) -> Rigidity:
    """Estimate EI from the beam at rest and under a weight, in the frame of the beam at rest.

    The weight pulls in the calibration plane, across the beam at rest. Raises InputError where
    the images do not determine EI, or contradict that weight at that place, or the stated beam.
    """
    length = loaded[0].rig.beam.length
    if not (math.isfinite(weight.force) and weight.force > 0):
        raise InputError(f"the weight is {weight.force:g} N, allowed is a finite number above 0")
    if not 0 < weight.at < length:
        raise InputError(
            f"the weight hangs at {1e3 * weight.at:g} mm, allowed is on the beam, "
            f"above 0 and below {1e3 * length:g} mm"
        )
    if loaded[0].rig.known_psi:
        raise InputError(
            "a hung weight bends the beam in the board's plane, and beam.known_psi_deg states "
            "another one"
        )
    groups = (_pool(rest, "at rest"), _pool(loaded, "under the weight"))
    start = _linear_start(groups, weight.at, length)
    problem = _Problem(groups, loaded[0], weight, abs(start[0]))
    result = _fitted(problem, start)
    fit, scatter = result.fit, result.scatter
    covariance, known_shape = (
        np.linalg.pinv(jacobian.T @ jacobian, hermitian=True)
        for jacobian in (fit.jac, fit.jac[:, :_OWN])
    )
    ratio, ratio_sigma = abs(float(fit.x[0])), math.sqrt(covariance[0, 0])
    if not np.abs(result.residuals).max() < _NO_SHAPE:
        raise InputError(
            f"no beam of {1e3 * length:g} mm under a weight fits the images: is its slope above "
            f"{math.degrees(_MAX_SLOPE):.0f} deg, or does another force bend it?"
        )
    if not fit.success or not ratio > _MIN_LOAD_SIGMAS * ratio_sigma:
        raise InputError(
            "the weight bends the beam too little to determine EI: use a heavier one or a larger "
            "distance from the clamp"
        )
    _check_consistency(fit.x[5:7], problem.prior_sigmas[1:3], scatter, fit.x[_OWN:])
    value = weight.force / (ratio * problem.unit)
    sigma, known_shape_sigma = (
        value * math.hypot(of_ratio / ratio, weight.force_sigma / weight.force)
        for of_ratio in (ratio_sigma, math.sqrt(known_shape[0, 0]))
    )
    rest_shape = problem.beam(fit.x, loaded=False)
    assert rest_shape is not None
    return Rigidity(
        value=value,
        sigma=sigma,
        known_shape_sigma=known_shape_sigma,
        at=weight.at + float(fit.x[5] * problem.prior_sigmas[1]),
        at_sigma=math.sqrt(covariance[5, 5]) * float(problem.prior_sigmas[1]),
        sag=float(rest_shape(rest_shape.x[-1])),
        misfit=scatter,
    )


class _Points(NamedTuple):
    """Points (n, 2) [m] of several images, in order along the beam, and their sigma vectors."""

    points: Floats
    sigmas: Floats


class _Problem:
    """Residuals of the points at rest and under the weight, and of the parameters' priors.

    The parameters are load and own weight [unit, unit / length], the clamp's offset [length] and
    tilt [rad], and, in sigmas of their priors: the clamp's position along the beam, the weight's
    place, the level, the scale, and deviations from the stated shape of the beam and its clamp.
    """

    def __init__(
        self,
        groups: tuple[_Points, _Points],
        loaded: Measurement,
        weight: HungWeight,
        unit: float,
    ) -> None:
        self.groups, self.weight, self.unit = groups, weight, unit
        self.length, self._viewpoint = loaded.rig.beam.length, loaded.view.viewpoint
        base = math.sqrt(loaded.base_covariance[0, 0])
        sigmas = [base, weight.at_sigma, weight.level_sigma, loaded.scale_sigma]
        self.prior_sigmas = np.maximum(sigmas, 1e-9)
        self.stated = _Stated(loaded)

    def beam(self, p: Floats, *, loaded: bool) -> CubicHermiteSpline | None:
        """Compute the beam with parameters p (n,), with or without the weight, as `hung_beam`."""
        _, shift_place, level, _ = p[4:_OWN] * self.prior_sigmas
        softness, clamp_shift, _, *widths = self.stated.shape(p[_OWN:])
        # The place is measured from the clamp; without a weight it does not matter.
        at = self.weight.at + shift_place - clamp_shift * self.length
        return hung_beam(
            p[0] * self.unit if loaded else 0.0,
            p[1] * self.unit / self.length,
            at if loaded else 0.5 * self.length,
            level,
            self.length,
            tuple(widths),
            softness,
        )

    def residuals(self, p: Floats, inflation: Floats) -> Floats:
        """Compute the residuals (n,) [sigma] of points and priors; the former over `inflation`."""
        y, tilt = p[2] * self.length, p[3]
        shift_x, _, _, scale = p[4:_OWN] * self.prior_sigmas
        _, clamp_shift, skew, *_ = self.stated.shape(p[_OWN:])
        clamp = [shift_x + clamp_shift * self.length, y]
        rotation = turn_about_z(tilt)[:2, :2]
        rows = []
        for (points, sigmas), loaded, factor in zip(
            self.groups, (False, True), inflation, strict=True
        ):
            curve = self.beam(p, loaded=loaded)
            if curve is None:
                # No shape under a large trial load: the fit rejects the step.
                rows.append(np.full(len(points), _NO_SHAPE))
                continue
            at_clamp = (self._in_plane(points, skew) / (1 + scale) - clamp) @ rotation
            rows.append(_distances(curve, at_clamp, sigmas @ rotation) / factor)
        return np.concatenate([*rows, p[4:]])

    def _in_plane(self, points: Floats, skew: float) -> Floats:
        """Project points (n, 2) on C along their rays to the plane of bending, and then onto C."""
        if not skew:
            return points
        in_plane, *_ = unproject(points, self._viewpoint, skew)
        return in_plane * [1.0, math.cos(skew)]


class _Fitted(NamedTuple):
    """SciPy's result, the residuals (n,) [sigma], and the scatter of the points about the beam."""

    fit: Any
    residuals: Floats
    scatter: float


def _fitted(problem: _Problem, start: Floats) -> _Fitted:
    """Fit the parameters from a start by linear theory, whose loads are in SI units."""
    length, at_sigma = problem.length, problem.prior_sigmas[1]
    # Loads are in units of the linear estimate, which does not depend on the rig's EI.
    units = [problem.unit, problem.unit / length, length, 1.0]
    start = np.concatenate([start / units, np.zeros(4 + problem.stated.errors.shape[1])])
    # Of all parameters, only the weight's place is bounded: by the beam's ends.
    low, high = np.full(len(start), -np.inf), np.full(len(start), np.inf)
    low[5], high[5] = (np.array([_MIN_PLACE, _MAX_PLACE]) * length - problem.weight.at) / at_sigma
    start[5] = np.clip(0.0, low[5], high[5])
    sizes = [len(points) for points, _ in problem.groups]
    inflation = np.ones(2)
    # The first pass estimates how far errors exceed their sigmas, and their correlation length.
    for _ in range(2):
        fit = least_squares(
            problem.residuals,
            start,
            bounds=(low, high),
            loss=partial(_loss, sum(sizes)),
            f_scale=_ROBUST_SIGMAS,
            diff_step=1e-4,
            args=(inflation,),
        )
        start = fit.x
        unweighted = problem.residuals(fit.x, np.ones(2))
        residuals_by_group = (unweighted[: sizes[0]], unweighted[sizes[0] : sum(sizes)])
        scatter = [SIGMA_OVER_MAD * float(np.median(np.abs(group))) for group in residuals_by_group]
        inflation = np.array(
            [
                max(sigma_ratio, 1.0) * math.sqrt(correlation_length(group))
                for sigma_ratio, group in zip(scatter, residuals_by_group, strict=True)
            ]
        )
    return _Fitted(fit, unweighted, max(scatter))


class _Stated:
    """What the rig states of the beam's shape: its means, and independent errors of one sigma.

    The shape is (softness, clamp shift, skew, widths), as in `BeamShape`, in the beam's frame;
    `errors` (k, m) are m errors of the k parameters. A bow is left out: at rest, it is fitted as
    the beam's own weight.
    """

    def __init__(self, measurement: Measurement) -> None:
        shape = measurement.rig.shape
        values, covariance = in_beam_frame(shape, measurement.handedness)
        count = FIRST_WIDTH + len(shape.widths)
        variances, directions = np.linalg.eigh(covariance[:count, :count])
        uncertain = variances > 0
        self._mean = values[:count]
        self.errors = directions[:, uncertain] * np.sqrt(variances[uncertain])

    def shape(self, deviations: Floats) -> list[float]:
        """Return the shape's parameters (k,) at deviations (m,) [sigma]."""
        return [float(value) for value in self._mean + self.errors @ deviations]


def _loss(points: int, z: Floats) -> Floats:
    """Compute soft L1 of the first `points` squared residuals, and plain squares of the priors.

    A robust prior would lose its weight as soon as the images disagree with it.
    """
    root = np.sqrt(1 + z)
    robust = np.array([2 * (root - 1), 1 / root, -0.5 / root**3])
    robust[:, points:] = [z[points:], np.ones(len(z) - points), np.zeros(len(z) - points)]
    return robust


def _check_consistency(deviations: Floats, sigmas: Floats, misfit: float, of_shape: Floats) -> None:
    """Reject a weight, level or shape that contradicts the images. Raises InputError.

    `deviations` (2,) are the deviations of the weight's place and of the clamp's level, in units of
    `sigmas` (2,), [m] and [rad]; `misfit` is the points' scatter about the fitted shape; `of_shape`
    (m,) [sigma] are deviations from the stated shape.
    """
    place, level = deviations * sigmas
    if misfit > _MAX_MISFIT:
        raise InputError(
            f"the points deviate by {misfit:.1f} sigma from the fitted beam, allowed is "
            f"{_MAX_MISFIT:g}: only the weight may bend the beam, and nothing "
            "may touch it"
        )
    of_beam = float(np.abs(of_shape).max(initial=0.0))
    if of_beam > max(_MAX_DEVIATION, np.abs(deviations).max()):
        raise InputError(
            f"the beam or its clamp is {of_beam:.0f} sigmas from what rig.json states: correct "
            "beam_shape, or learn the beam"
        )
    largest = int(np.argmax(np.abs(deviations)))
    if abs(deviations[largest]) <= _MAX_DEVIATION:
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
    load: float,
    own: float,
    at: float,
    level: float,
    length: float,
    widths: tuple[float, ...] = (),
    softness: float = 0.0,
) -> CubicHermiteSpline | None:
    """Compute y(x) [m] of a clamped beam under `load` = W / EI [1/m^2] at arc length `at` [m].

    `own` = w / EI [1/m^3] is its own weight's. The clamp points down by `level` [rad]. `widths` and
    `softness` are those of `BeamShape`; EI and w are those at the clamp. Accurate to 1e-7 of the
    length. Return None where the beam turns too steeply or no shape is found.
    """
    if not 0 < at < length or least_width(np.array(widths)) < LEAST_WIDTH:
        return None
    spans = np.array([at, length - at])[:, None]
    width = Polynomial([1.0])
    if widths:
        width += Polynomial([0.0, 1.0]) * Legendre(widths, [0, 1]).convert(kind=Polynomial)
    # In the order of `np.polyval`, which takes less time.
    width_terms: Floats = np.asarray(width.coef[::-1], np.float64)
    volume_terms: Floats = length * np.asarray((width**2).integ().coef[::-1], np.float64)
    volume = float(np.polyval(volume_terms, 1.0))

    def derivatives(t: Floats, state: Floats) -> Floats:
        theta, moment = state[0:2], state[2:4]
        s = np.vstack([at * t, at + (length - at) * t]) / length
        load_ahead = own * (volume - np.polyval(volume_terms, s))
        load_ahead[0] += load
        rates = [
            moment / np.polyval(width_terms, s) ** 4,
            -load_ahead * np.cos(theta + level),
            np.cos(theta),
            np.sin(theta),
        ]
        return np.vstack([spans * rate for rate in rates])

    def boundary(start: Floats, end: Floats) -> Floats:
        # Clamped at the origin, continuous where the weight hangs, free at the tip.
        jumps = end[0::2] - start[1::2]
        turned = start[0] - softness * length * start[2]
        return np.array([turned, start[4], start[6], end[3], *jumps])

    solution = solve_bvp(derivatives, boundary, np.linspace(0, 1, 11), np.zeros((8, 11)), tol=1e-6)
    state = solution.sol(_NODES)
    theta = np.concatenate([state[0], state[1][1:]])
    if not solution.success or np.abs(theta).max() > _MAX_SLOPE:
        return None
    x, y = (np.concatenate([part[0], part[1][1:]]) for part in (state[4:6], state[6:8]))
    return CubicHermiteSpline(x, y, np.tan(theta))


def _pool(measurements: Sequence[Measurement], when: str) -> _Points:
    """Pool the points of several images and their sigma vectors, in order along the beam."""
    points = np.vstack([measurement.points for measurement in measurements])
    sigmas = np.vstack([measurement.sigma_vectors for measurement in measurements])
    if len(points) < _MIN_POINTS:
        raise InputError(
            f"the images of the beam {when} show {len(points)} points, needed are {_MIN_POINTS}"
        )
    order = np.argsort(points[:, 0], kind="stable")
    return _Points(points[order], sigmas[order])


def _linear_start(groups: Sequence[_Points], at: float, length: float) -> Floats:
    """Estimate the fit's start (4,) by linear theory, eqs. (9) and (10).

    Its values are load and own weight [1/m^2, 1/m^3], offset [m] and tilt [rad] at rest. They
    are fitted jointly to the beam at rest and under the weight, with a clamp that is offset and
    tilted. The loads are halved until the beam has a shape.
    """
    design, y = [], []
    for (points, _), loaded in zip(groups, (False, True), strict=True):
        x = points[:, 0]
        bent = unit_deflection(x, at) / 6 * loaded
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
    return np.asarray(start)


def _distances(curve: CubicHermiteSpline, points: Floats, sigmas: Floats) -> Floats:
    """Compute distances (n,) of points from the curve along its normal, over their sigmas."""
    slope = curve(points[:, 0], 1)
    normal = np.column_stack([-slope, np.ones_like(slope)])
    residuals = points[:, 1] - curve(points[:, 0])
    return np.asarray(residuals / np.abs((sigmas * normal).sum(axis=1)))
