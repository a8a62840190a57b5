"""Errors of an image of the beam: of its radiance, and of the beam's apparent position."""

import math
from dataclasses import dataclass
from time import perf_counter

import cv2
import numpy as np

from solver.instrument.arrays import Floats, Mask
from solver.instrument.transforms import apply
from vbaa_bench.assembly.pose import Pose
from vbaa_bench.render.frame import MAX_SAMPLES, RenderedRadiance
from vbaa_bench.render.tracing import trace
from vbaa_bench.render.world import World
from vbaa_bench.scene.rigs import TrueRig

# Minimum half-height of a centroid's window, and its minimum margin above and below the beam.
_WINDOW_PX, _MARGIN_PX = 4, 3
# Number of renderings averaged for a reference, if there is time.
_MAX_RENDERINGS = 32


@dataclass(frozen=True)
class Line:
    """Position of a beam in an image, with a window about it.

    `rows` (width,) are those of its centreline in every column, nan if undefined; `half`
    is half the height of the window.
    """

    rows: Floats
    half: int

    def centroids(self, image: Floats, reference: Floats) -> Floats:
        """Compute the row (width,) of the light's centroid in every column's window.

        The mean of `reference` (height, width) in the window's end rows is subtracted first. The
        result is nan where the reference has less than half of its median light: the beam is
        hidden there.
        """
        inside = (self.rows >= self.half) & (self.rows < len(image) - self.half - 0.5)
        columns = np.flatnonzero(inside)
        offsets = np.arange(-self.half, self.half + 1)[:, None]
        rows = np.rint(self.rows[columns]).astype(int) + offsets
        background = reference[rows[[0, -1]], columns].mean(axis=0)
        light, expected = image[rows, columns] - background, reference[rows, columns] - background
        centroids = np.full(len(self.rows), np.nan)
        lit = expected.sum(axis=0) > np.median(expected.sum(axis=0)) / 2
        centroid = (light * rows)[:, lit].sum(axis=0) / light[:, lit].sum(axis=0)
        centroids[columns[lit]] = centroid
        return centroids


def beam_line(rig: TrueRig, pose: Pose) -> Line:
    """Compute the true position of a pose's beam in the image, from left to right as in methods."""
    state, camera = pose.state, rig.camera
    camera_frame_from_clamp = pose.camera_frame_from_clamp
    points = apply(camera_frame_from_clamp, state.centreline[:, 1:]) + rig.base_position
    u, v = camera.project(points).T
    rows = np.interp(np.arange(camera.width), u, v, left=np.nan, right=np.nan)
    radius_px = rig.beam.radius * float(camera.pixels_per_metre(points).max())
    return Line(rows, max(_WINDOW_PX, math.ceil(radius_px) + _MARGIN_PX))


@dataclass(frozen=True)
class Reference:
    """True image of a pose about the beam.

    `radiance` (height, width) holds where `known`; `beam` are the beam's own pixels and their
    neighbours; `noise_over_peak` is the residual noise of the radiance over the peak.
    """

    radiance: Floats
    known: Mask
    beam: Mask
    line: Line
    peak: float
    noise_over_peak: float

    def errors(self, radiance: Floats) -> tuple[float, float]:
        """Compute mean squared errors: of the beam's radiance over its peak, centroids [px^2]."""
        difference = (radiance - self.radiance)[self.beam] / self.peak
        truth = self.line.centroids(self.radiance, self.radiance)
        shift = self.line.centroids(radiance, self.radiance) - truth
        return float(np.mean(difference**2)), float(np.nanmean(shift**2))


def reference_of(world: World, seen: RenderedRadiance, line: Line, seconds: float) -> Reference:
    """Average many renderings, each with our renderer's maximum number of samples."""
    square = np.ones((3, 3), np.uint8)
    beam = cv2.dilate((seen.coverage > 0).astype(np.uint8), square) > 0
    known = beam.copy()
    for column in np.flatnonzero(~np.isnan(line.rows)):
        middle = round(line.rows[column])
        known[max(middle - line.half, 0) : max(middle + line.half + 1, 0), column] = True
    rows, columns = np.nonzero(known)
    pixels, samples = np.column_stack([columns, rows]), np.full(len(rows), MAX_SAMPLES)
    start, renderings = perf_counter(), list[Floats]()
    while len(renderings) < 2 or (
        len(renderings) < _MAX_RENDERINGS and perf_counter() - start < seconds
    ):
        renderings.append(
            trace(world, pixels, samples, 7_000_000 * (1 + len(renderings)), "whole").radiance
        )
    mean = np.zeros(known.shape)
    mean[known] = np.mean(renderings, axis=0)
    peak = float(np.quantile(mean[seen.core], 0.99))
    noise = np.zeros(known.shape)
    noise[known] = np.var(renderings, axis=0, ddof=1) / len(renderings)
    return Reference(mean, known, beam, line, peak, float(np.sqrt(noise[beam].mean())) / peak)
