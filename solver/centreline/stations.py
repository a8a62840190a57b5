"""Pixel columns, or rows where the beam is steep, along a path: where the beam is measured."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from solver.instrument.arrays import Floats


@dataclass(frozen=True)
class Stations:
    """n places along the beam, from the clamp to beyond the tip.

    `along` (n,) is the pixel column that is read, or the row where not `upright` (n,); `start`
    (n,) [px] is where in it the path crosses; `climb` (n,) is the path's slope there, in size at
    most 1. `sense` (n,) is -1 where the column runs against the beam's own normal, else 1.
    `length` (n,) [px] is how far along the path a station is.
    """

    along: npt.NDArray[np.int64]
    upright: npt.NDArray[np.bool_]
    start: Floats
    climb: Floats
    sense: Floats
    length: Floats

    def __len__(self) -> int:
        return len(self.along)

    def pixels(self, centre: Floats) -> Floats:
        """Pixels (n, 2), as (u, v), of centres (n,) in their columns or rows."""
        along = self.along.astype(np.float64)
        return np.column_stack(
            [np.where(self.upright, along, centre), np.where(self.upright, centre, along)]
        )

    @property
    def directions(self) -> Floats:
        """Unit vectors (n, 2) along which the centres are measured."""
        down = self.upright.astype(np.float64)
        return np.column_stack([1 - down, down])


def stations(path: Floats, shape: tuple[int, ...]) -> Stations:
    """Stations along a path of pixels (m, 2), within an image of `shape`."""
    step = np.diff(path, axis=0)
    travelled = np.concatenate([[0.0], np.cumsum(np.hypot(step[:, 0], step[:, 1]))])
    flat = np.abs(step[:, 0]) >= np.abs(step[:, 1])
    pieces = []
    # Stretches of one kind; a path is smooth, so it has few.
    turns = np.flatnonzero(np.diff(flat.astype(np.int8))) + 1
    for first, last in zip([0, *turns], [*turns, len(flat)], strict=True):
        upright = bool(flat[first])
        axis = 0 if upright else 1
        a, b, s = path[first : last + 1, axis], path[first : last + 1, 1 - axis], travelled
        s = s[first : last + 1]
        if a[-1] < a[0]:
            a, b, s = a[::-1], b[::-1], s[::-1]
        if np.any(np.diff(a) <= 0):
            continue
        lines = np.arange(max(np.ceil(a[0]), 0), min(np.floor(a[-1]) + 1, shape[1 - axis]))
        start = np.interp(lines, a, b)
        middle, climb = (a[1:] + a[:-1]) / 2, np.diff(b) / np.diff(a)
        # Going from the clamp to the tip, the normal is a quarter turn from u towards v.
        forward = np.sign(path[last, axis] - path[first, axis])
        sense = forward if upright else -forward
        pieces.append(
            (
                lines.astype(np.int64),
                np.full(len(lines), upright),
                start,
                np.clip(np.interp(lines, middle, climb), -1, 1),
                np.full(len(lines), float(sense)),
                np.interp(lines, a, s),
            )
        )
    if not pieces:
        empty = np.empty(0)
        return Stations(empty.astype(np.int64), empty.astype(bool), empty, empty, empty, empty)
    columns = [np.concatenate(values) for values in zip(*pieces, strict=True)]
    order = np.argsort(columns[5], kind="stable")
    return Stations(*(values[order] for values in columns))
