"""Stations: the pixel columns, or rows where the beam is steep, that measure it along a path."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from solver.instrument.arrays import Floats, Mask
from solver.instrument.compiled import njit


@dataclass(frozen=True)
class Stations:
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

    def __len__(self) -> int:
        return len(self.along)


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
        limit = width if upright else height
        segment = path[first : last + 1]
        along, across = (
            (segment[:, 0], segment[:, 1]) if upright else (segment[:, 1], segment[:, 0])
        )
        count = _walk(along, across, distance[first : last + 1], upright, limit, out, count)
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
    limit: int,
    out: Floats,
    count: int,
) -> int:
    """Write a segment's stations into the columns of `out` from `count` on; return the count."""
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
        if not 0 <= position < limit:
            continue
        while k < last - 1 and forward * (position - along[k + 1]) > 0:
            k += 1
        fraction = (position - along[k]) / (along[k + 1] - along[k])
        # Slopes are those at the midpoints between nodes.
        node = min(max(k if fraction < 0.5 else k + 1, 1), last - 1)
        climb = slope[0]
        if last > 1:
            before = (along[node - 1] + along[node]) / 2
            after = (along[node] + along[node + 1]) / 2
            weight = min(max((position - before) / (after - before), 0.0), 1.0)
            climb = slope[node - 1] + weight * (slope[node] - slope[node - 1])
        out[0, count], out[1, count] = position, upright
        out[2, count] = across[k] + (position - along[k]) * slope[k]
        out[3, count] = min(max(climb, -1.0), 1.0)
        # Going from the clamp to the tip, the normal is a quarter turn from u towards v.
        out[4, count] = forward if upright else -forward
        out[5, count] = distance[k] + fraction * (distance[k + 1] - distance[k])
        count += 1
    return count
