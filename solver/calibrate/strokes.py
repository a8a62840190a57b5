"""Tracing of a printed line across the image: sub-pixel centres, a smooth curve, its width."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.polynomial import legendre
from scipy.ndimage import map_coordinates

from solver.instrument.arrays import Floats

# A lens bends lines little and smoothly: degree five leaves errors below a thousandth of a pixel.
_DEGREE: Final = 5
# Centres are measured clear of the crossing lines, and beyond the last crossing before the line
# ends: shares of the distance between two crossings.
_CLEAR, _BEYOND = 0.22, 0.42
# The blur spreads a line's darkness by this many pixels on either side.
_SKIRT_PX: Final = 4.0
_STEP_PX: Final = 0.5
# Least half width of a window: lines nearer to each other overlap.
_LEAST_REACH_PX: Final = 3.0
_ROUNDS: Final = 3
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
        apart = points - self.origin
        return apart @ self.half / (self.half @ self.half), apart @ self.normal

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
    curve = Curve(middle, half, _robust(t, offset, min(3, len(t) - 1)))
    along, spacing = _clear_of_crossings(t, numbers, float(np.linalg.norm(half)))
    reach = min(widest / 2 + _SKIRT_PX, 0.4 * spacing)
    if reach < _LEAST_REACH_PX:
        return None
    across = np.linspace(-reach, reach, 2 * round(reach / _STEP_PX) + 1)
    degree, width = min(_DEGREE, len(nodes) - 1), 0.0
    # Each round centres the windows on the fitted line, so that the card's contribution to the
    # darkness biases the centre to neither side.
    for _ in range(_ROUNDS):
        points, tangents = curve.at(along)
        normals = np.column_stack([-tangents[:, 1], tangents[:, 0]])
        normals /= np.linalg.norm(normals, axis=1)[:, None]
        window = points[:, None] + across[:, None] * normals[:, None]
        profile = map_coordinates(
            spline, (window[..., 1], window[..., 0]), order=3, prefilter=False, cval=np.nan
        )
        seen = np.isfinite(profile).all(axis=1)
        if not seen.any():
            return None
        shift, area = _shifts(profile[seen], across)
        width = float(np.median(area))
        clear = (area > 0.5 * width) & (np.abs(shift) < reach)
        seen[seen], shift = clear, shift[clear]
        if len(shift) <= 2 * degree:
            return None
        t, offset = curve.place(points[seen] + shift[:, None] * normals[seen])
        curve = Curve(middle, half, _robust(t, offset, degree))
    return Stroke(curve, width)


def _shifts(profiles: Floats, across: Floats) -> tuple[Floats, Floats]:
    """Estimate shifts (n,) [px] of lines from the middle of their profiles (n, m), and areas [px].

    Every profile is modelled as the common one, made symmetric, moved and scaled, on a card that
    may be brighter on one side, which would bias a centroid towards the darker side.
    """
    common = profiles.mean(axis=0)
    common = (common + common[::-1]) / 2
    step = across[1] - across[0]
    design = np.column_stack([common, -np.gradient(common, step), np.ones_like(across), across])
    dark, moved, _, _ = np.linalg.lstsq(design, profiles.T, rcond=None)[0]
    ink = common - common[[0, -1]].mean()
    return moved / dark, np.asarray(dark * ink.sum() * step)


def crossing(one: Curve, other: Curve, near: Floats) -> Floats:
    """Compute the intersection (2,) [px] of two curves by Newton's method from `near` (2,)."""
    t = np.array([one.place(near[None])[0][0], other.place(near[None])[0][0]])
    for _ in range(_ROUNDS + 2):
        (here,), (along_one,) = one.at(t[:1])
        (there,), (along_other,) = other.at(t[1:])
        t += np.linalg.solve(np.column_stack([along_one, -along_other]), there - here)
    return np.asarray(one.at(t[:1])[0][0])


def _clear_of_crossings(t: Floats, numbers: Sequence[int], half: float) -> tuple[Floats, float]:
    """Return places along a line, a pixel apart, clear of crossings; the least spacing [px]."""
    pieces, least = [], np.inf
    for (left, right), (a, b) in zip(pairwise(t), pairwise(numbers), strict=True):
        gap = float(right - left) / (b - a)
        least = min(least, gap * half)
        if b - a == 1:  # skip a gap with a missed crossing
            pieces.append((left + _CLEAR * gap, right - _CLEAR * gap))
        if left == t[0]:
            pieces.append((left - _BEYOND * gap, left - _CLEAR * gap))
        if right == t[-1]:
            pieces.append((right + _CLEAR * gap, right + _BEYOND * gap))
    filled = [np.linspace(*piece, max(3, round((piece[1] - piece[0]) * half))) for piece in pieces]
    return np.concatenate(filled), float(least)


def _robust(t: Floats, offset: Floats, degree: int) -> Floats:
    """Fit Legendre coefficients with Huber's weights, which limit the influence of dirt."""
    weight = np.ones_like(t)
    for _ in range(_ROUNDS):
        fitted = np.asarray(legendre.legfit(t, offset, degree, w=np.sqrt(weight)), np.float64)
        residual = np.abs(offset - legendre.legval(t, fitted))
        scale = _HUBER * 1.4826 * float(np.median(residual)) + 1e-12
        weight = np.minimum(1.0, scale / np.maximum(residual, 1e-12))
    return fitted
