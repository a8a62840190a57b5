"""How much of the beam an image shows, from the share of every pixel that the beam covers.

A thin beam misses the centres of many pixels; its centreline is always within pixels that it
covers, unless something hides it there.
"""

from dataclasses import dataclass

import numpy as np

from solver.instrument.arrays import Floats, Mask
from solver.instrument.camera import Camera

# The length is judged in this many equal segments, each at points no farther apart than this [px].
_STRETCHES = 100
_APART_PX = 0.5
# Flanks of the beam that are looked at beside its middle, in radii: what covers the middle alone
# hides nothing.
_ACROSS = (-0.5, 0.0, 0.5)


@dataclass(frozen=True)
class Visibility:
    """The visible part of the beam, in even hundredths of its length.

    `visible_share` of the whole length; `availability`, the paper's ratio AR (eq. 32), of what
    would be seen if nothing hid it; `hidden_stretches` (n, 2), from and to as shares of the length.
    """

    visible_share: float
    availability: float
    hidden_stretches: Floats


def visibility(coverage: Floats, camera: Camera, centreline: Floats, radius: float) -> Visibility:
    """Compare the beam's `coverage` (height, width) of pixels with where the beam is.

    `centreline` (n, 4): arc length and place [m] in Sigma_a; `radius` [m]. A stretch is visible if
    the beam covers any part of a pixel there, hidden if it covers none of those in the image.
    """
    scale = float(camera.pixels_per_metre(centreline[:, 1:]).max())
    length = float(centreline[-1, 0])
    points = max(int(np.ceil(length * scale / _APART_PX / _STRETCHES)), 4)
    s = (np.arange(_STRETCHES * points) + 0.5) / (_STRETCHES * points) * length
    place = np.column_stack([np.interp(s, centreline[:, 0], axis) for axis in centreline[:, 1:].T])
    middle = camera.project(place)
    along = np.gradient(middle, axis=0)
    normal = np.column_stack([-along[:, 1], along[:, 0]])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    flanks = camera.pixels_per_metre(place)[:, None] * radius * normal
    seen, inside = np.zeros((2, len(s)), np.bool_)
    for share in _ACROSS:
        here, covered = _looked_up(coverage, middle + share * flanks)
        seen |= covered
        inside |= here
    visible, in_image = (flags.reshape(_STRETCHES, points).any(axis=1) for flags in (seen, inside))
    hidden = in_image & ~visible
    steps = np.diff(np.concatenate([[0], hidden.astype(int), [0]]))
    stretches = np.column_stack([np.flatnonzero(steps > 0), np.flatnonzero(steps < 0)])
    share_of_image = float(visible.sum() / max(np.count_nonzero(in_image), 1))
    return Visibility(float(visible.mean()), share_of_image, stretches / _STRETCHES)


def _looked_up(coverage: Floats, pixels: Floats) -> tuple[Mask, Mask]:
    """Whether places (n, 2) [px] are in the image, and in a pixel that is covered."""
    height, width = coverage.shape
    column, row = np.rint(np.clip(pixels, -1e6, 1e6)).astype(int).T
    inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
    covered = inside.copy()
    covered[inside] = coverage[row[inside], column[inside]] > 0
    return inside, covered
