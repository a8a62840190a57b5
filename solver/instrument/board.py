"""Calibration targets: printed pattern and coordinates of the points."""

from dataclasses import dataclass
from typing import ClassVar, Final

import numpy as np

from solver.instrument.arrays import Floats

DICTIONARIES: Final = ("4x4_50", "4x4_100", "4x4_250", "4x4_1000")


@dataclass(frozen=True)
class Board:
    """Calibration target of `columns` x `rows` points with spacing `square` [m]."""

    kind: ClassVar[str]
    columns: int
    rows: int
    square: float

    def corners(self) -> Floats:
        """Return the points (rows * columns, 3) [m] in the board's frame, row by row.

        The origin is the centre of the pattern, x points along the rows, z towards the viewer.
        """
        y, x = np.mgrid[0 : self.rows, 0 : self.columns].astype(float)
        x -= (self.columns - 1) / 2
        y = (self.rows - 1) / 2 - y
        return np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)]) * self.square


@dataclass(frozen=True)
class Chessboard(Board):
    """Chessboard whose upper left square is black; the points are the inner corners."""

    kind = "chessboard"


@dataclass(frozen=True)
class Charuco(Board):
    """Chessboard with a marker in the middle of every white square, numbered row by row.

    `dictionary` is one of OpenCV's: markers of 4 x 4 bits with a black border one bit wide. A bit
    is a tenth of a square, so that a marker keeps a distance of two tenths from the corners. Raises
    ValueError if the dictionary has too few markers.
    """

    kind = "charuco"
    dictionary: str

    def __post_init__(self) -> None:
        needed, available = (
            (self.columns + 1) * (self.rows + 1) // 2,
            int(self.dictionary.split("_")[1]),
        )
        if needed > available:
            raise ValueError(
                f"a board of {self.columns} x {self.rows} corners has {needed} markers, "
                f"the dictionary {self.dictionary} only {available}"
            )


@dataclass(frozen=True)
class LineNetwork(Board):
    """Grid of dark lines of `line_width` [m]; the points are their crossings, at right angles.

    One line in each direction, `thick_column` and `thick_row`, is twice as wide. With these two,
    every crossing can be identified even if the image shows only a part of the grid. Lines extend
    half a square beyond the last crossing. Raises ValueError if the lines are too wide to be
    separated.
    """

    kind = "lines"
    line_width: float

    def __post_init__(self) -> None:
        if not 0 < self.line_width <= self.square / 8:
            raise ValueError(
                f"the line width is {self.line_width / self.square:.3g} of a square, "
                "allowed is up to 0.125"
            )

    @property
    def thick_column(self) -> int:
        """Index of the thick line along y, counted from the left."""
        return (self.columns - 1) // 2

    @property
    def thick_row(self) -> int:
        """Index of the thick line along x, counted from the top."""
        return (self.rows - 1) // 2
