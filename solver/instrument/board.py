"""Calibration targets: what is printed on the card, and where its points lie."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from solver.instrument.arrays import Floats

DICTIONARIES: Final = ("4x4_50", "4x4_100", "4x4_250", "4x4_1000")


@dataclass(frozen=True)
class Board:
    """A target of `columns` x `rows` points, `square` [m] apart."""

    columns: int
    rows: int
    square: float

    def corners(self) -> Floats:
        """The points (rows * columns, 3) [m] in the board's frame, row by row.

        The origin is the middle of the pattern, x runs along the rows, z towards the viewer.
        """
        y, x = np.mgrid[0 : self.rows, 0 : self.columns].astype(float)
        x -= (self.columns - 1) / 2
        y = (self.rows - 1) / 2 - y
        return np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)]) * self.square


@dataclass(frozen=True)
class Chessboard(Board):
    """Squares, of which that at the upper left is black; the points are their inner corners."""


@dataclass(frozen=True)
class Charuco(Board):
    """A chessboard with a marker in the middle of every white square, numbered row by row.

    `dictionary` is one of OpenCV's: markers of 4 x 4 bits in a black rim of one. A bit is a tenth
    of a square, so that a marker stays two tenths away from the corners. Raises ValueError if the
    dictionary has not enough markers.
    """

    dictionary: str

    def __post_init__(self) -> None:
        needed, held = (self.columns + 1) * (self.rows + 1) // 2, int(self.dictionary.split("_")[1])
        if needed > held:
            raise ValueError(
                f"a board of {self.columns} x {self.rows} corners has {needed} markers, "
                f"the dictionary {self.dictionary} only {held}"
            )


@dataclass(frozen=True)
class LineNetwork(Board):
    """Dark lines of `line_width` [m] that cross at right angles; the points are the crossings.

    One line each way, `thick_column` and `thick_row`, is twice as wide: from them every crossing
    is told even where the image shows a part of the network. Lines run on for half a square
    beyond the last crossing. Raises ValueError if the lines are too wide to be told apart.
    """

    line_width: float

    def __post_init__(self) -> None:
        if not 0 < self.line_width <= self.square / 8:
            raise ValueError(
                f"the lines are {self.line_width / self.square:.3g} of their distance wide, "
                "allowed is up to 0.125"
            )

    @property
    def thick_column(self) -> int:
        """The thick line along y, counted from the left."""
        return (self.columns - 1) // 2

    @property
    def thick_row(self) -> int:
        """The thick line along x, counted from the top."""
        return (self.rows - 1) // 2
