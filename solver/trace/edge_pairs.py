"""Sub-pixel positions of both edges of a beam in profiles across it.

In each channel a profile is left L before the edge at a, right R behind the edge at b, and I + G x
between them, where x goes from -1 at a to 1 at b: two steps, of any sign and size, blurred by one
error function. Only pixels near an edge count, so that a highlight or grain in the middle does not;
outlying pixels lose their weight (Cauchy), and a channel counts by the scatter of its residuals.
The width has a prior, which a beam of a pixel or two needs: blur, width and contrast are then not
separable, and the middle of the edges does not depend on which of them is assumed.
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
# Least scatter of the residuals [gray]. Derived: that of rounding.
MIN_SCATTER: Final = 0.3
ITERATIONS: Final = 12


class EdgePairs(NamedTuple):
    """Edges of n profiles: `left` and `right` [px], `contrast` (n, 2) [gray] of each.

    A contrast is the length of the difference of all channels. `misfit` (n,) [gray] is the mean
    size of the residuals, `residual` (n, c m) those near the edges, one channel after the other, in
    units of their scatter, at most 3 in size, `centre_sigma` (n,) [px] the standard error of the
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
    """Fit both edges in profiles (c, n, m) of c channels, sampled at `across` (m,) [px].

    `left` and `right` (n,) are first values; their distance is the prior of the width, with
    `width_sigma` [px]. `blur` [px] is the standard deviation of the blur.
    """
    a, b = left.copy(), right.copy()
    prior = b - a
    stiffness = np.array([[1.0, -1.0], [-1.0, 1.0]]) / width_sigma**2
    information = np.zeros((len(a), 2, 2))
    levels = np.zeros((*profiles.shape[:2], 4))
    scatter = np.ones(profiles.shape[:2])
    limit = np.maximum(prior / 4, blur)
    for iteration in range(ITERATIONS):
        by_edges, basis = _model(across, a, b, levels, blur)
        residual = profiles - np.einsum("nmk,cnk->cnm", basis, levels)
        window = _window(across, a, b, blur)
        size = np.abs(_steps(levels)).max(axis=2)
        weight = np.broadcast_to(window, residual.shape)
        if iteration > 2:  # the first iterations find the levels
            scatter = _scatter(residual, window)
            cut = CAUCHY * np.hypot(scatter, UNMODELLED * size)
            weight = window / (1 + (residual / cut[..., None]) ** 2)
        weight = weight / scatter[..., None] ** 2
        # The levels of each channel are eliminated from the normal equations.
        edges, bases = (np.swapaxes(part, -1, -2) for part in (by_edges, basis))
        inner = (bases * weight[..., None, :]) @ basis
        flat = 1 / (MAX_SLOPE * np.maximum(np.linalg.norm(size, axis=0), 1.0)) ** 2
        inner[..., 3, 3] += flat
        inner += 1e-6 * np.eye(4)
        mixed = (edges * weight[..., None, :]) @ basis
        weighted = (weight * residual)[..., None]
        by_levels = bases @ weighted
        by_levels[..., 3, 0] -= flat * levels[..., 3]
        solved = np.linalg.solve(inner, np.concatenate([np.swapaxes(mixed, -1, -2), by_levels], -1))
        information = (
            stiffness
            + 1e-6 * np.eye(2)
            + np.sum((edges * weight[..., None, :]) @ by_edges - mixed @ solved[..., :2], axis=0)
        )
        pull = (prior - (b - a))[:, None] * [-1.0, 1.0] / width_sigma**2
        vector = pull + np.sum(edges @ weighted - mixed @ solved[..., 2:], axis=0)[..., 0]
        step = np.linalg.solve(information, vector[..., None])[..., 0]
        levels += solved[..., 2] - (solved[..., :2] @ step[..., None])[..., 0]
        if iteration > 0:
            a += np.clip(step[:, 0], -limit, limit)
            b += np.clip(step[:, 1], -limit, limit)
            # The edges stay in the profile, and in this order.
            a = np.clip(a, across[0], across[-1] - 0.2 * prior)
            b = np.clip(b, a + 0.2 * prior, across[-1])
    variance = np.linalg.inv(information).sum(axis=(1, 2)) / 4
    misfit = (np.abs(residual) * window).sum(axis=(0, 2)) / window.sum(axis=1)
    residual = np.clip(residual / scatter[..., None], -3, 3) * window
    return EdgePairs(
        left=a,
        right=b,
        contrast=np.linalg.norm(_steps(levels), axis=0),
        misfit=misfit,
        residual=np.concatenate(list(residual), axis=1),
        centre_sigma=np.sqrt(variance),
    )


def _model(
    across: Floats, a: Floats, b: Floats, levels: Floats, blur: float
) -> tuple[Floats, Floats]:
    """Compute the gradients of profiles: by a and b (c, n, m, 2), and by the levels (n, m, 4)."""
    to_a, to_b = (across - a[:, None]) / blur, (across - b[:, None]) / blur
    past_a, past_b = ndtr(to_a), ndtr(to_b)
    slope = np.clip((2 * across - (a + b)[:, None]) / (b - a)[:, None], -1, 1)
    inside = past_a - past_b
    basis = np.stack([1 - past_a, past_b, inside, inside * slope], axis=-1)
    density = np.exp(-0.5 * np.stack([to_a, to_b], axis=-1) ** 2) / (blur * np.sqrt(2 * np.pi))
    return density * _steps(levels)[:, :, None] * [-1.0, 1.0], basis


def _steps(levels: Floats) -> Floats:
    """Compute the steps (c, n, 2) from outside to inside of both edges."""
    return levels[..., 2, None] + levels[..., 3, None] * [-1.0, 1.0] - levels[..., :2]


def _window(across: Floats, a: Floats, b: Floats, blur: float) -> Floats:
    """Weigh the pixels (n, m) that are near an edge by 1, others by 0."""
    reach = np.maximum(REACH_WIDTHS * (b - a), max(REACH_BLURS * blur, REACH_PX))[:, None]
    near = np.minimum(np.abs(across - a[:, None]), np.abs(across - b[:, None]))
    return np.asarray(near < reach, np.float64)


def _scatter(residual: Floats, window: Floats) -> Floats:
    """Estimate the robust scatter (c, n) of the residuals within the window."""
    sizes = np.sort(np.where(window > 0, np.abs(residual), np.inf), axis=2)
    middle = np.count_nonzero(window, axis=1) // 2
    return np.maximum(SIGMA_OVER_MAD * sizes[:, np.arange(len(middle)), middle], MIN_SCATTER)
