"""Tracing of a printed line across the image: sub-pixel centres, a smooth curve, its width."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.polynomial import legendre
from scipy.ndimage import map_coordinates

from solver.instrument.arrays import Floats
from solver.instrument.medians import SIGMA_OVER_MAD

# A lens bends lines little and smoothly: degree five leaves errors below a thousandth of a pixel.
_DEGREE: Final = 5
# Centres are measured clear of the crossing lines, and beyond the last crossing before the line
# ends: fractions of the distance between two crossings.
_CLEARANCE, _EXTENSION = 0.22, 0.42
# The blur spreads a line's darkness by this many pixels on either side.
_BLUR_MARGIN_PX: Final = 4.0
_STEP_PX: Final = 0.5
# Least half width of a window: lines nearer to each other overlap.
_MIN_HALF_WIDTH_PX: Final = 3.0
_ITERATIONS: Final = 3
_HUBER: Final = 1.5


@dataclass(frozen=True)
class Curve:
    """origin + t half + offset(t) normal, t about -1..1; all of shape (2,) [px].

    The offset is a sum of Legendre polynomials.
    """

    origin: Floats
    half: Floats
    offset: Floats

    @property
    def normal(self) -> Floats:
        """Unit vector across the chord."""
        return np.asarray(np.array([-self.half[1], self.half[0]]) / np.linalg.norm(self.half))

    def place(self, points: Floats) -> tuple[Floats, Floats]:
        """Compute t (n,) and the offset (n,) [px] of points (n, 2)."""
        relative = points - self.origin
        return relative @ self.half / (self.half @ self.half), relative @ self.normal

    def at(self, t: Floats) -> tuple[Floats, Floats]:
        """Compute points (n, 2) [px] and their derivatives (n, 2) by t."""
        offset = legendre.legval(t, self.offset)[:, None]
        slope = legendre.legval(t, legendre.legder(self.offset))[:, None]
        points = self.origin + t[:, None] * self.half + offset * self.normal
        return points, self.half + slope * self.normal


@dataclass(frozen=True)
class Stroke:
    """A line's centre curve, and its width [px]: the integral of the darkness across it."""

    curve: Curve
    width: float


def stroke(spline: Floats, numbers: Sequence[int], nodes: Floats, widest: float) -> Stroke | None:
    """Trace the line through its crossings `nodes` (n, 2) [px], the `numbers`-th ones, in order.

    `spline` (height, width) are cubic spline coefficients of the blurred darkness, 0 on the card
    and 1 in ink. No line is wider than `widest` [px]. Return None if too little of it is
    visible.
    """
    middle, half = (nodes[0] + nodes[-1]) / 2, (nodes[-1] - nodes[0]) / 2
    curve = Curve(middle, half, np.zeros(1))
    t, offset = curve.place(nodes)
    if not (np.diff(t) > 0).all():
        return None
    curve = Curve(middle, half, _robust_fit(t, offset, min(3, len(t) - 1)))
    positions, spacing = _between_crossings(t, numbers, float(np.linalg.norm(half)))
    half_width = min(widest / 2 + _BLUR_MARGIN_PX, 0.4 * spacing)
    if half_width < _MIN_HALF_WIDTH_PX:
        return None
    across = np.linspace(-half_width, half_width, 2 * round(half_width / _STEP_PX) + 1)
    degree, width = min(_DEGREE, len(nodes) - 1), 0.0
    # Each round centres the windows on the fitted line, so that the card's contribution to the
    # darkness biases the centre to neither side.
    for _ in range(_ITERATIONS):
        points, tangents = curve.at(positions)
        normals = np.column_stack([-tangents[:, 1], tangents[:, 0]])
        normals /= np.linalg.norm(normals, axis=1)[:, None]
        window = points[:, None] + across[:, None] * normals[:, None]
        profile = map_coordinates(
            spline, (window[..., 1], window[..., 0]), order=3, prefilter=False, cval=np.nan
        )
        valid = np.isfinite(profile).all(axis=1)
        if not valid.any():
            return None
        shift, area = _shifts(profile[valid], across)
        width = float(np.median(area))
        accepted = (area > 0.5 * width) & (np.abs(shift) < half_width)
        valid[valid], shift = accepted, shift[accepted]
        if len(shift) <= 2 * degree:
            return None
        t, offset = curve.place(points[valid] + shift[:, None] * normals[valid])
        curve = Curve(middle, half, _robust_fit(t, offset, degree))
    return Stroke(curve, width)


def _shifts(profiles: Floats, across: Floats) -> tuple[Floats, Floats]:
    """Estimate shifts (n,) [px] of lines from the middle of their profiles (n, m), and areas [px].

    Every profile is modelled as the common one, made symmetric, moved and scaled, on a card that
    may be brighter on one side, which would bias a centroid towards the darker side.
    """
    template = profiles.mean(axis=0)
    template = (template + template[::-1]) / 2
    step = across[1] - across[0]
    design = np.column_stack([template, -np.gradient(template, step), np.ones_like(across), across])
    contrast, scaled_shift, _, _ = np.linalg.lstsq(design, profiles.T, rcond=None)[0]
    ink = template - template[[0, -1]].mean()
    return scaled_shift / contrast, np.asarray(contrast * ink.sum() * step)


def crossing(one: Curve, other: Curve, near: Floats) -> Floats:
    """Compute the intersection (2,) [px] of two curves by Newton's method from `near` (2,)."""
    t = np.array([one.place(near[None])[0][0], other.place(near[None])[0][0]])
    for _ in range(_ITERATIONS + 2):
        (point_one,), (tangent_one,) = one.at(t[:1])
        (point_other,), (tangent_other,) = other.at(t[1:])
        t += np.linalg.solve(
            np.column_stack([tangent_one, -tangent_other]), point_other - point_one
        )
    return np.asarray(one.at(t[:1])[0][0])


def _between_crossings(t: Floats, numbers: Sequence[int], half: float) -> tuple[Floats, float]:
    """Return places along a line, a pixel apart, clear of crossings; the least spacing [px]."""
    intervals, min_spacing = [], np.inf
    for (left, right), (a, b) in zip(pairwise(t), pairwise(numbers), strict=True):
        gap = float(right - left) / (b - a)
        min_spacing = min(min_spacing, gap * half)
        if b - a == 1:  # skip a gap with a missed crossing
            intervals.append((left + _CLEARANCE * gap, right - _CLEARANCE * gap))
        if left == t[0]:
            intervals.append((left - _EXTENSION * gap, left - _CLEARANCE * gap))
        if right == t[-1]:
            intervals.append((right + _CLEARANCE * gap, right + _EXTENSION * gap))
    samples = [
        np.linspace(*interval, max(3, round((interval[1] - interval[0]) * half)))
        for interval in intervals
    ]
    return np.concatenate(samples), float(min_spacing)


def _robust_fit(t: Floats, offset: Floats, degree: int) -> Floats:
    """Fit Legendre coefficients with Huber's weights, which limit the influence of dirt."""
    weight = np.ones_like(t)
    for _ in range(_ITERATIONS):
        fitted = np.asarray(legendre.legfit(t, offset, degree, w=np.sqrt(weight)), np.float64)
        residual = np.abs(offset - legendre.legval(t, fitted))
        scale = _HUBER * SIGMA_OVER_MAD * float(np.median(residual)) + 1e-12
        weight = np.minimum(1.0, scale / np.maximum(residual, 1e-12))
    return fitted
