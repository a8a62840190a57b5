"""Logging of points, lines and arrows to a recording of rerun, with the styles of this viewer."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from solver.instrument.arrays import Floats
from vbaa_bench.report import palette


class Log(NamedTuple):
    """A recording: the module `rerun`, which is an optional package, and the stream written to.

    Colours are #rrggbb, sizes are in points of the screen unless stated otherwise. An entity
    without points or lines vanishes until it has some again.
    """

    rr: Any
    stream: Any

    def write(self, entity: str, *values: Any, static: bool = False) -> None:
        """Write an entity at the current time, or once for all times."""
        self.stream.log(entity, *values, static=static)

    def points(
        self, entity: str, points: Sequence[Floats], colour: str, size: float, label: str = ""
    ) -> None:
        """Write points in a plane or in space, with a label that is shown on hovering."""
        kind = self.rr.Points3D if entity.startswith("space/3d") else self.rr.Points2D
        radii, labels = self.rr.Radius.ui_points(size), [label] * len(points) if label else None
        self.write(
            entity, kind(points, colors=rgb(colour), radii=radii, labels=labels, show_labels=False)
        )

    def lines(
        self,
        entity: str,
        lines: Sequence[Any],
        colour: str,
        width: float = 1.0,
        *,
        static: bool = False,
    ) -> None:
        """Write lines in a plane or in space."""
        kind = self.rr.LineStrips3D if entity.startswith("space/3d") else self.rr.LineStrips2D
        radii = self.rr.Radius.ui_points(width)
        self.write(entity, kind(lines, colors=rgb(colour), radii=radii), static=static)


def rgb(colour: str) -> tuple[int, int, int]:
    """Convert a colour #rrggbb to three numbers."""
    blue, green, red = palette.bgr(colour)
    return red, green, blue


def present(point: Floats | None) -> list[np.ndarray]:
    """Return a list of the point (2,) or (3,); an empty list for None."""
    return [] if point is None else [point]
