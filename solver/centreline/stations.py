"""Stations: the pixel columns, or rows where the beam is steep, that measure it along a path."""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from solver.instrument.arrays import Floats, Grey, Mask
from solver.instrument.compiled import njit

# Image rows and columns of pixels, each of the shape of the array of their gray values.
PixelIndex = tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]


class Stations(NamedTuple):
    """n places along the beam, from the clamp to beyond the tip.

    `along` (n,) is the pixel column that is read, or the row where not `upright` (n,); `start`
    (n,) [px] is the path's position in it; `climb` (n,) is the path's slope there, in size at
    most 1. `sense` (n,) is -1 where the column runs against the beam's own normal, else 1.
    `length` (n,) [px] is the distance of a station along the path.
    """

    along: npt.NDArray[np.int64]
    upright: Mask
    start: Floats
    climb: Floats
    sense: Floats
    length: Floats

    @property
    def size(self) -> int:
        """Number of stations."""
        return len(self.along)

    def take(self, which: Any) -> "Stations":
        """Return the stations at indices, in a mask or in a slice."""
        return Stations(*(values[which] for values in self))

    def moved(self, off_path: Floats) -> "Stations":
        """Move the path by `off_path` (n,) [px] along its normal."""
        return self._replace(start=self.start + self.sense * off_path)

    def within(self, half: int, shape: tuple[int, ...]) -> Mask:
        """Mark stations (n,) with `half` pixels on either side of the path in an image."""
        middle, limit = np.rint(self.start), np.where(self.upright, shape[0], shape[1])
        return np.asarray((middle >= half) & (middle < limit - half))

    def pixels(self, half: int) -> PixelIndex:
        """Index the pixels (n, 2 half + 1) of the columns about the path."""
        middle = np.rint(self.start).astype(np.int64)
        return column_pixels(self.along, middle, self.upright, half)

    def offset(self, half: int) -> Floats:
        """Compute the distance [px] of these pixels from the path, along the path's own normal."""
        across = np.rint(self.start)[:, None] + np.arange(-half, half + 1)
        return np.asarray(self.sense[:, None] * (across - self.start[:, None]))


# A numpy scalar is compiled once, a literal anew.
_FIRST: Any = np.int64(0)


def stations(path: Floats, shape: tuple[int, ...]) -> Stations:
    """Compute the stations along a path of pixels (m, 2), within an image of `shape`."""
    # For another layout, the function would be compiled again.
    return Stations(*_stations(np.ascontiguousarray(path), shape[0], shape[1]))


@njit
def _stations(path: Floats, height: int, width: int) -> Any:
    distance = np.zeros(len(path))
    for k in range(1, len(path)):
        step = np.hypot(path[k, 0] - path[k - 1, 0], path[k, 1] - path[k - 1, 1])
        distance[k] = distance[k - 1] + step
    # Upper bound: a station for every pixel of the path, and one more for every corner.
    out = np.empty((6, int(distance[-1]) + 2 * len(path)))
    count, first = _FIRST, 0
    # Segments with columns only or rows only; a path is smooth, so it has few.
    while first < len(path) - 1:
        upright = _flat(path, first)
        last = first + 1
        while last < len(path) - 1 and _flat(path, last) == upright:
            last += 1
        limits = (width, height) if upright else (height, width)
        segment = path[first : last + 1]
        along, across = (
            (segment[:, 0], segment[:, 1]) if upright else (segment[:, 1], segment[:, 0])
        )
        count = _walk(along, across, distance[first : last + 1], upright, limits, out, count)
        first = last
    return (
        out[0, :count].astype(np.int64),
        out[1, :count] == 1,
        out[2, :count],
        out[3, :count],
        out[4, :count],
        out[5, :count],
    )


@njit
def _flat(path: Floats, k: int) -> bool:
    """Return whether the path runs mainly along the image rows from node k to the next."""
    return bool(abs(path[k + 1, 0] - path[k, 0]) >= abs(path[k + 1, 1] - path[k, 1]))


@njit
def _walk(
    along: Floats,
    across: Floats,
    distance: Floats,
    upright: bool,
    limits: tuple[int, int],
    out: Floats,
    count: int,
) -> int:
    """Write a segment's stations into the columns of `out` from `count` on; return the count.

    `limits` are the numbers of pixels along the path and across it.
    """
    forward = np.sign(along[-1] - along[0])
    last = len(along) - 1
    slope = np.empty(last)
    for k in range(last):
        if forward * (along[k + 1] - along[k]) <= 0:
            return count
        slope[k] = (across[k + 1] - across[k]) / (along[k + 1] - along[k])
    k = 0
    line = np.ceil(forward * along[0])
    while line <= forward * along[last]:
        position = forward * line
        line += 1
        if not 0 <= position < limits[0]:
            continue
        while k < last - 1 and forward * (position - along[k + 1]) > 0:
            k += 1
        fraction = (position - along[k]) / (along[k + 1] - along[k])
        middle = across[k] + (position - along[k]) * slope[k]
        if not -0.5 <= middle < limits[1] - 0.5:
            continue
        # Slopes are those at the midpoints between nodes.
        node = min(max(k if fraction < 0.5 else k + 1, 1), last - 1)
        climb = slope[0]
        if last > 1:
            before = (along[node - 1] + along[node]) / 2
            after = (along[node] + along[node + 1]) / 2
            weight = min(max((position - before) / (after - before), 0.0), 1.0)
            climb = slope[node - 1] + weight * (slope[node] - slope[node - 1])
        out[0, count], out[1, count] = position, upright
        out[2, count] = middle
        out[3, count] = min(max(climb, -1.0), 1.0)
        # Going from the clamp to the tip, the normal is a quarter turn from u towards v.
        out[4, count] = forward if upright else -forward
        out[5, count] = distance[k] + fraction * (distance[k + 1] - distance[k])
        count += 1
    return count


def column_pixels(
    along: npt.NDArray[np.int64], middle: npt.NDArray[np.int64], upright: Mask, half: int
) -> PixelIndex:
    """Index the pixels (n, 2 half + 1) about a `middle` (n,) of columns, or of rows."""
    across = middle[:, None] + np.arange(-half, half + 1)
    lines = np.broadcast_to(along[:, None], across.shape)
    columns = upright[:, None]
    return np.where(columns, across, lines), np.where(columns, lines, across)


@njit
def read_column(image: Grey, line: int, upright: bool, first: int, gray: Floats) -> bool:
    """Fill `gray` from pixel `first` of a column (a row); return False where the image ends."""
    height, width = image.shape
    limit, n_lines = (height, width) if upright else (width, height)
    if first < 0 or first + len(gray) > limit or line < 0 or line >= n_lines:
        return False
    for k in range(len(gray)):
        gray[k] = image[first + k, line] if upright else image[line, first + k]
    return True
