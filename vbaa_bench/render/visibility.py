"""Visible fraction of the beam in an image, from the beam's coverage of every pixel.

A thin beam misses the centres of many pixels. The pixels along its centreline have nonzero
coverage, unless something hides the beam there.
"""

from dataclasses import dataclass

import numpy as np

from solver.instrument.arrays import Floats, Mask
from solver.instrument.camera import Camera

# Number of equal segments of the length, and maximum spacing [px] of test points in a segment.
_SEGMENTS = 100
_SPACING_PX = 0.5
# Test points across the beam, in radii: an occluder that covers only the middle hides nothing.
_ACROSS = (-0.5, 0.0, 0.5)


@dataclass(frozen=True)
class Visibility:
    """The visible part of the beam, in equal hundredths of its length.

    `visible_share` is relative to the whole length; `availability`, the paper's ratio AR (eq. 32),
    is relative to the part that is within the image; `hidden_stretches` (n, 2) holds start and end
    of each hidden stretch as fractions of the length.
    """

    visible_share: float
    availability: float
    hidden_stretches: Floats


def visibility(coverage: Floats, camera: Camera, centreline: Floats, radius: float) -> Visibility:
    """Compare the beam's `coverage` (height, width) of pixels with its projected position.

    `centreline` (n, 4) holds arc length and position [m] in Sigma_a; `radius` is in [m]. A segment
    is visible if the beam covers any part of a pixel there, and hidden if it is in the image and
    the beam covers none of its pixels.
    """
    scale = float(camera.pixels_per_metre(centreline[:, 1:]).max())
    length = float(centreline[-1, 0])
    points = max(int(np.ceil(length * scale / _SPACING_PX / _SEGMENTS)), 4)
    s = (np.arange(_SEGMENTS * points) + 0.5) / (_SEGMENTS * points) * length
    xyz = np.column_stack([np.interp(s, centreline[:, 0], axis) for axis in centreline[:, 1:].T])
    pixels = camera.project(xyz)
    along = np.gradient(pixels, axis=0)
    normal = np.column_stack([-along[:, 1], along[:, 0]])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    half_widths = camera.pixels_per_metre(xyz)[:, None] * radius * normal
    covered, inside = np.zeros((2, len(s)), np.bool_)
    for offset in _ACROSS:
        is_inside, is_covered = _look_up(coverage, pixels + offset * half_widths)
        covered |= is_covered
        inside |= is_inside
    visible, in_image = (
        flags.reshape(_SEGMENTS, points).any(axis=1) for flags in (covered, inside)
    )
    hidden = in_image & ~visible
    steps = np.diff(np.concatenate([[0], hidden.astype(int), [0]]))
    stretches = np.column_stack([np.flatnonzero(steps > 0), np.flatnonzero(steps < 0)])
    availability = float(visible.sum() / max(np.count_nonzero(in_image), 1))
    return Visibility(float(visible.mean()), availability, stretches / _SEGMENTS)


def _look_up(coverage: Floats, pixels: Floats) -> tuple[Mask, Mask]:
    """Test whether places (n, 2) [px] are in the image, and in a covered pixel."""
    height, width = coverage.shape
    column, row = np.rint(pixels).T
    inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
    covered = inside.copy()
    covered[inside] = coverage[row[inside].astype(int), column[inside].astype(int)] > 0
    return inside, covered
