"""Sections across a beam in a photograph: their places, and the profiles of the image in them."""

from typing import Final, NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

from solver.centreline.smooth import DEGREE, curve
from solver.centreline.thresholds import THRESHOLDS
from solver.instrument.arrays import Floats

# Degree of the width's course: a beam is uniform or tapered, and perspective tapers it as well.
TAPER: Final = np.int64(1)
# Sections along the beam: one per width, within these numbers. Chosen: MIN_SECTIONS leave room for
# rejected ones, MAX_SECTIONS are more than a fit needs.
MIN_SECTIONS, MAX_SECTIONS = 80, 400
# Sections begin and end at this many widths from the marks, plus pixels for the marks' errors.
END_WIDTHS, END_PX = 0.5, 3.0
# Part of the beam whose slope an end has that is not fitted. Chosen: the slope of a polynomial at
# its very end is uncertain.
END_PART: Final = 0.1
# A profile reaches this far beyond the middle, has this many samples per width, and is averaged
# over at most MOST_ALONG rows along the beam.
REACH_WIDTHS, REACH_PX, SAMPLES, MOST_ALONG = 0.9, 6.0, 60, 12
# Least scatter [px] of the points of a course. Chosen: below the error of any of them.
_LEAST_SCATTER: Final = 0.01


class Chord(NamedTuple):
    """Axes of the line from the clamp to the tip: `origin` (2,) [px] and unit vector `along`."""

    origin: Floats
    along: Floats

    def places(self, points: Floats) -> tuple[Floats, Floats]:
        """Convert points (n, 2) to distances along and across the line (n,) [px]."""
        x, y = self._axes() @ (points - self.origin).T
        return x, y

    def sections(self, x: Floats, y: Floats, at: Floats) -> "Sections":
        """Place sections at distances `at` (n,) on a smooth curve through the places x and y.

        Beyond the outermost places it is straight, with the mean slope of their part END_PART.
        """
        low, high = x.min(), x.max()
        step = END_PART * (high - low)
        ends = np.array([low, low + step, high - step, high])
        first, second, third, last = course(x, y, ends, DEGREE)
        smooth = course(x, y, at, DEGREE)
        smooth += (second - first) / step * np.minimum(at - low, 0)
        smooth += (last - third) / step * np.maximum(at - high, 0)
        axes = self._axes()
        tangents = np.column_stack([np.ones(len(at)), np.gradient(smooth, at)]) @ axes
        tangents /= np.linalg.norm(tangents, axis=1)[:, None]
        return Sections(at, self.origin + np.column_stack([at, smooth]) @ axes, tangents)

    def _axes(self) -> Floats:
        return np.array([self.along, [-self.along[1], self.along[0]]])


class Sections(NamedTuple):
    """Sections across a beam: distances `x` (n,), `points` (n, 2) [px] and unit `tangents`."""

    x: Floats
    points: Floats
    tangents: Floats

    @property
    def normals(self) -> Floats:
        """Unit vectors (n, 2), a quarter turn from the tangents, from u towards v."""
        return np.column_stack([-self.tangents[:, 1], self.tangents[:, 0]])

    def profiles(self, image: npt.NDArray[np.float32], width: float) -> tuple[Floats, Floats]:
        """Sample profiles (c, n, m) of an image's c channels at distances (m,) along the normals.

        Each is a mean along the beam, from halfway to the section before to halfway to the next.
        """
        reach = REACH_WIDTHS * width + REACH_PX
        across = np.arange(-reach, reach, max(0.5, width / SAMPLES))
        spacing = float(np.median(np.linalg.norm(np.diff(self.points, axis=0), axis=1)))
        count = int(np.clip(spacing, 1, MOST_ALONG))
        shifts = (np.arange(count) - (count - 1) / 2) * spacing / count
        grid = (
            self.points[:, None, None]
            + shifts[:, None, None] * self.tangents[:, None, None]
            + across[:, None] * self.normals[:, None, None]
        )
        maps = grid.reshape(len(self.x) * count, len(across), 2).astype(np.float32)
        sampled = cv2.remap(
            image, maps[..., 0], maps[..., 1], cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE
        ).reshape(len(self.x), count, len(across), -1)
        return np.moveaxis(sampled.mean(axis=1, dtype=np.float64), 2, 0), across


def section_places(length: float, width: float) -> Floats:
    """Compute the distances (n,) [px] of the sections of a beam of this length and width [px]."""
    margin = END_WIDTHS * width + END_PX
    return np.linspace(
        margin, length - margin, int(np.clip(length / width, MIN_SECTIONS, MAX_SECTIONS))
    )


def course(x: Floats, y: Floats, at: Floats, degree: np.int64) -> Floats:
    """Evaluate a robust polynomial through y (n,) at x (n,), or their median if there is none."""
    values: Floats = curve(x, y, np.full(len(x), _LEAST_SCATTER), at, degree, THRESHOLDS.tukey_cut)
    return values if len(values) else np.full(len(at), float(np.median(y)))
