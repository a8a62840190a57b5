"""Drawing of measured and rejected points on an enlarged image, one colour per kind."""

from typing import Any, Final

import cv2
import numpy as np
import numpy.typing as npt

from solver.centreline import Centreline, Flag
from solver.instrument.arrays import Floats, Grey
from solver.instrument.images import eight_bit

Picture = npt.NDArray[np.uint8]
Colour = tuple[int, int, int]

# Colours in the order blue, green, red. They are those of the benchmark's report.
MEASURED: Final = (20, 232, 255)
REJECTED: Final = {
    Flag.HIDDEN: (255, 107, 47),
    Flag.SATURATED: (0, 74, 255),
    Flag.FOREIGN: (240, 28, 240),
}
TIP: Final = (255, 245, 60)
SHIFT: Final = 4  # OpenCV draws at sixteenths of a pixel


def enlarged(image: Grey, factor: int) -> Picture:
    """Convert an image to BGR and enlarge it by the whole number `factor`."""
    large = eight_bit(image).repeat(factor, axis=0).repeat(factor, axis=1)
    return np.asarray(cv2.cvtColor(large, cv2.COLOR_GRAY2BGR), dtype=np.uint8)


def place(point: Floats, factor: int) -> tuple[int, int]:
    """Map a pixel of the image to the enlarged picture, in 2^-SHIFT px, clipped at 10^6."""
    scaled = (np.asarray(point) + 0.5) * factor - 0.5
    u, v = np.clip(np.rint(scaled * 2**SHIFT), -1e6, 1e6)
    return int(u), int(v)


def mark(picture: Any, line: Centreline, factor: int) -> None:
    """Draw measured points as yellow dots, rejected ones in the colour of their reason.

    Rejected points are blue (hidden), orange (saturated) or purple (foreign).
    """
    _dots(picture, line.points, factor, MEASURED)
    for flag, colour in REJECTED.items():
        _dots(picture, line.rejected[line.flags == flag], factor, colour)


def _dots(picture: Any, points: Floats, factor: int, colour: Colour) -> None:
    radius = round(0.25 * factor * 2**SHIFT)
    for point in points:
        cv2.circle(picture, place(point, factor), radius, colour, cv2.FILLED, cv2.LINE_AA, SHIFT)
