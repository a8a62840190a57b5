"""Mean of the beam in the rest images, place by place on the pixel grid."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from solver.calibrate import Calibration
from solver.centreline import Centreline
from solver.instrument.arrays import Floats
from solver.planes.plane_c import on_plane


class MeanLine(NamedTuple):
    """Mean of the rest images: points (n, 2) on C [m] and their sigma (n,) along y [m].

    `random` is the part of the points' variance that differs from image to image, over the square
    of sigma. `row` (n,) [px] is the points' position on the pixel grid, across the beam; `pixel`
    [m] is the size of a pixel.
    """

    points: Floats
    sigma: Floats
    random: float
    row: Floats
    pixel: float

    @property
    def rows(self) -> float:
        """Number of pixel rows that the beam crosses."""
        return float(np.ptp(self.row))


def mean_line(lines: Sequence[Centreline], calibration: Calibration) -> MeanLine:
    """Average the images place by place.

    A centre's error on the pixel grid is the same in all of them, so four images are not twice as
    accurate as one.
    """
    pixels = np.vstack([line.points for line in lines])
    if not len(pixels):
        return MeanLine(np.empty((0, 2)), np.empty(0), 1.0, np.empty(0), 0.0)
    directions = np.vstack([line.directions for line in lines])
    sigma = np.concatenate([line.sigma for line in lines])
    _, first, index, count = np.unique(
        np.concatenate([place_keys(line) for line in lines]),
        return_index=True,
        return_inverse=True,
        return_counts=True,
    )
    mean = np.column_stack([np.bincount(index, pixels[:, i]) / count for i in (0, 1)])
    mean_sigma = np.bincount(index, sigma) / count
    deviations = ((pixels - mean[index]) ** 2).sum(axis=1) / mean_sigma[index] ** 2
    repeated = count > 1
    # A single image cannot separate noise from errors that repeat: its sigma is used.
    random = 1.0
    if repeated.any():
        squares = np.bincount(index, deviations)[repeated] / (count[repeated] - 1)
        random = float(np.mean(squares / count[repeated]))
    points, vectors = on_plane(calibration.camera, mean, directions[first] * mean_sigma[:, None])
    # Of an error measured obliquely to the beam, only the part across the beam counts.
    order = np.argsort(points[:, 0])
    tilt = math.atan(np.polyfit(points[:, 0], points[:, 1], 1)[0]) if len(points) > 2 else 0.0
    across = np.abs(vectors @ [-math.sin(tilt), math.cos(tilt)]) / math.cos(tilt)
    row = (mean * directions[first]).sum(axis=1)
    pixel = float(np.median(across / mean_sigma))
    return MeanLine(points[order], np.maximum(across[order], 1e-12), random, row[order], pixel)


def place_keys(line: Centreline) -> Floats:
    """Number every place that is read: columns count from 0 up, rows down from -1."""
    columns = line.directions[:, 1] != 0
    return np.asarray(np.where(columns, line.points[:, 0], -1 - line.points[:, 1]))


def centres(line: Centreline) -> Floats:
    """Return each point's position in its column or row."""
    return np.asarray((line.points * line.directions).sum(axis=1))
