"""The beam's silhouette in every pixel column, by which samples are stratified."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Self

import drjit as dr
import mitsuba as mi
import numpy as np

from solver.instrument.arrays import Floats, Mask
from solver.instrument.camera import Camera
from vbaa_bench.render.device_array import device_array, index_of
from vbaa_bench.render.pixel_strata import PixelStrata, pixel_strata

# The mesh's edges are straight between rings, in space but not through a distorting lens, and are
# rounded to single precision: they depart from the silhouette by less. Chosen; where they depart by
# more, a pixel beside the beam has more noise.
_MARGIN_PX = 0.02


@dataclass(frozen=True)
class Silhouette:
    """Edges of the beam in an image of `shape` (height, width), in pixels from its corner.

    `edges` (4, n) holds, for every pixel column, the lower and the upper edge at its left side,
    then both at its right side; all are 0 where the column does not show the beam. With `upright`
    it holds the same for pixel rows, with x and y exchanged. The beam ends within the columns of
    `ends` (n,), whose samples are not stratified.
    """

    edges: Floats
    ends: Mask
    upright: bool
    shape: tuple[int, int]

    @classmethod
    def of(cls, rings: Floats, camera: Camera) -> Self | None:
        """Project a beam's rings of vertices (m, facets, 3) [m] in Sigma_a.

        Return None if the beam turns back in the image, so that a column shows it twice.
        """
        pixels = camera.project(rings.reshape(-1, 3)).reshape(*rings.shape[:2], 2) + 0.5
        middle, shape = pixels.mean(axis=1), (camera.height, camera.width)
        upright = bool(np.ptp(middle[:, 1]) > np.ptp(middle[:, 0]))
        along, across = (1, 0) if upright else (0, 1)
        if middle[-1, along] < middle[0, along]:
            pixels = pixels[::-1]
        sides = np.arange(shape[0 if upright else 1] + 1.0)
        lines = []
        for extreme in (pixels[..., across].argmin(axis=1), pixels[..., across].argmax(axis=1)):
            outline = pixels[np.arange(len(pixels)), extreme]
            if not (np.diff(outline[:, along]) > 0).all():
                return None
            lines.append(np.interp(sides, outline[:, along], outline[:, across]))
        lower, upper = lines
        edges = np.array([lower[:-1], upper[:-1], lower[1:], upper[1:]])
        first, last = pixels[0, :, along], pixels[-1, :, along]
        edges[:, (sides[1:] <= first.min()) | (sides[:-1] >= last.max())] = 0.0
        ends = (sides[:-1] < first.max()) | (sides[1:] > last.min())
        return cls(edges, ends, upright, shape)

    @property
    def touched(self) -> Mask:
        """Pixels (height, width) that the silhouette touches, up to rounding."""
        lower, upper = self.edges[::2].min(axis=0), self.edges[1::2].max(axis=0)
        place = np.arange(self.shape[1 if self.upright else 0])[:, None]
        touched = (place + 1 > lower - _MARGIN_PX) & (place < upper + _MARGIN_PX) & (upper > lower)
        return np.asarray(touched.T if self.upright else touched)

    @cached_property
    def arrays(self) -> list[Any]:
        """The edges where samples are stratified, as Dr.Jit arrays."""
        return [device_array(edge) for edge in np.where(self.ends, 0.0, self.edges)]

    @property
    def state(self) -> Any:
        """All that a frozen function depends on."""
        return self.upright, self.arrays

    def strata(self, column: Any, row: Any, count: Any) -> PixelStrata:
        """Stratify `count` samples of pixels (Dr.Jit: column, row and count)."""
        origin, place = (column, row) if self.upright else (row, column)
        index = index_of(place, self.shape[0 if self.upright else 1])
        edges = [dr.gather(mi.Float, edge, index) - origin for edge in self.arrays]
        return pixel_strata(edges, mi.Bool(self.upright), count)
