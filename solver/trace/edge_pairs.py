"""Sub-pixel positions of both edges of a beam in profiles across it.

A profile is left L before the edge at a, right R behind the edge at b, and I + G x between them,
where x goes from -1 at a to 1 at b: two steps blurred by one error function. Only pixels near an
edge count, so that a highlight or grain in the middle does not; outlying pixels lose their weight
(Cauchy). The width has a prior, which a beam of a pixel or two needs: blur, width and contrast are
then not separable, and the middle of the edges does not depend on which of them is assumed.
"""

from typing import Final, NamedTuple

import numpy as np
from scipy.special import ndtr

from solver.instrument.arrays import Floats
from solver.instrument.medians import SIGMA_OVER_MAD

# Pixels about an edge that count: over the width and over the blur, and at least this many. Chosen:
# twice the tail of the blur, and few of a table's structure.
REACH_WIDTHS, REACH_BLURS, REACH_PX = 0.25, 3.0, 3.0
# A residual of this many robust scatters has half its weight. From 95 % efficiency for normal
# errors (Holland and Welsch 1977).
CAUCHY: Final = 2.385
# Residuals that a wrong blur and compression leave, over the contrast. Chosen: without it the
# pixels of a sharp edge are outliers; at 0.1 a beam's grain is none.
UNMODELLED: Final = 0.03
# Slope of the brightness between the edges, over the contrast: sigma of its prior. Chosen: in a
# beam of few pixels a slope and a shift are one.
MAX_SLOPE: Final = 0.1
ITERATIONS: Final = 12
_PARAMETERS: Final = 6


class EdgePairs(NamedTuple):
    """Edges of n profiles: `left` and `right` [px], `contrast` (n, 2) [gray] of both.

    `misfit` (n,) [gray] is the mean size of the residuals, `residual` (n, m) those near the edges
    in units of their scatter, at most 3 in size, `centre_sigma` (n,) [px] the standard error of the
    middle for independent samples.
    """

    left: Floats
    right: Floats
    contrast: Floats
    misfit: Floats
    residual: Floats
    centre_sigma: Floats

    @property
    def centre(self) -> Floats:
        """Middle of the edges (n,) [px]."""
        return np.asarray((self.left + self.right) / 2)

    @property
    def width(self) -> Floats:
        """Distance of the edges (n,) [px]."""
        return np.asarray(self.right - self.left)


def edge_pairs(
    profiles: Floats, across: Floats, left: Floats, right: Floats, width_sigma: float, blur: float
) -> EdgePairs:
    """Fit both edges in profiles (n, m), sampled at `across` (m,) [px].

    `left` and `right` (n,) are first values; their distance is the prior of the width, with
    `width_sigma` [px]. `blur` [px] is the standard deviation of the blur.
    """
    a, b = left.copy(), right.copy()
    prior = b - a
    information = np.zeros((len(a), _PARAMETERS, _PARAMETERS))
    levels = np.zeros((len(a), 4))
    scatter = np.full(len(a), np.inf)
    contrast = np.ones(len(a))
    limit = np.maximum(prior / 4, blur)
    for iteration in range(ITERATIONS):
        jacobian, basis = _model(across, a, b, levels, blur)
        residual = profiles - np.einsum("nmk,nk->nm", basis, levels)
        window = _window(across, a, b, blur)
        weight = window.copy()
        if iteration > 2:  # the first iterations find the levels
            scatter = _scatter(residual, window)
            width = CAUCHY * np.hypot(scatter, UNMODELLED * contrast)
            weight /= 1 + (residual / width[:, None]) ** 2
        normal = np.einsum("nmi,nm,nmj->nij", jacobian, weight, jacobian)
        vector = np.einsum("nmi,nm,nm->ni", jacobian, weight, residual)
        noise = np.where(np.isfinite(scatter), scatter, 1.0) ** 2
        stiff = noise / width_sigma**2
        for i, j in ((0, 0), (1, 1), (0, 1), (1, 0)):
            normal[:, i, j] += stiff if i == j else -stiff
        vector[:, 0] -= stiff * (prior - (b - a))
        vector[:, 1] += stiff * (prior - (b - a))
        contrast = np.abs(levels[:, 2] - (levels[:, 0] + levels[:, 1]) / 2)
        flat = noise / (MAX_SLOPE * np.maximum(contrast, 1.0)) ** 2
        normal[:, 5, 5] += flat
        vector[:, 5] -= flat * levels[:, 3]
        normal += 1e-6 * np.eye(_PARAMETERS)
        information = normal / noise[:, None, None]
        step = np.linalg.solve(normal, vector[..., None])[..., 0]
        levels += step[:, 2:]
        if iteration > 0:
            a += np.clip(step[:, 0], -limit, limit)
            b += np.clip(step[:, 1], -limit, limit)
            # The edges stay in the profile, and in this order.
            a = np.clip(a, across[0], across[-1] - 0.2 * prior)
            b = np.clip(b, a + 0.2 * prior, across[-1])
    covariance = np.linalg.inv(information)
    variance = (covariance[:, 0, 0] + covariance[:, 1, 1] + 2 * covariance[:, 0, 1]) / 4
    inner = levels[:, 2, None] + levels[:, 3, None] * [-1, 1]
    misfit = np.sum(np.abs(residual) * window, axis=1) / np.sum(window, axis=1)
    residual = np.clip(residual / scatter[:, None], -3, 3) * window
    return EdgePairs(a, b, inner - levels[:, :2], misfit, residual, np.sqrt(variance))


def _model(
    across: Floats, a: Floats, b: Floats, levels: Floats, blur: float
) -> tuple[Floats, Floats]:
    """Compute the Jacobian (n, m, 6) by (a, b, L, R, I, G), and that of the levels (n, m, 4)."""
    to_a, to_b = (across - a[:, None]) / blur, (across - b[:, None]) / blur
    past_a, past_b = ndtr(to_a), ndtr(to_b)
    slope = np.clip((2 * across - (a + b)[:, None]) / (b - a)[:, None], -1, 1)
    inside = past_a - past_b
    basis = np.stack([1 - past_a, past_b, inside, inside * slope], axis=-1)
    density_a = np.exp(-0.5 * to_a**2) / (blur * np.sqrt(2 * np.pi))
    density_b = np.exp(-0.5 * to_b**2) / (blur * np.sqrt(2 * np.pi))
    step_a = (levels[:, 2] - levels[:, 3] - levels[:, 0])[:, None]
    step_b = (levels[:, 1] - levels[:, 2] - levels[:, 3])[:, None]
    by_edges = np.stack([-density_a * step_a, -density_b * step_b], axis=-1)
    return np.concatenate([by_edges, basis], axis=-1), basis


def _window(across: Floats, a: Floats, b: Floats, blur: float) -> Floats:
    """Weigh the pixels (n, m) that are near an edge by 1, others by 0."""
    reach = np.maximum(REACH_WIDTHS * (b - a), max(REACH_BLURS * blur, REACH_PX))[:, None]
    near = np.minimum(np.abs(across - a[:, None]), np.abs(across - b[:, None]))
    return np.asarray(near < reach, np.float64)


def _scatter(residual: Floats, window: Floats) -> Floats:
    """Estimate the robust scatter (n,) of the residuals within the window; at least 0.3 gray."""
    inside = np.where(window > 0, np.abs(residual), np.nan)
    return np.asarray(np.maximum(SIGMA_OVER_MAD * np.nanmedian(inside, axis=1), 0.3))
