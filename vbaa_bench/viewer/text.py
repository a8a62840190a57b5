"""Text on pictures."""

from typing import Final

import cv2
import numpy as np

Colour = tuple[int, int, int]
# BGR. Chosen: black and white are in the palette of OpenCV's GIFs, which dithers other grays.
PAPER: Final = (0, 0, 0)
INK: Final = (255, 255, 255)
FAINT: Final = (160, 152, 145)
BOLD, REGULAR = 600, 400
_FONT: Final = cv2.FontFace("sans")


def write(
    canvas: np.ndarray,
    text: str,
    at: tuple[int, int],
    colour: Colour = INK,
    size: int = 16,
    weight: int = REGULAR,
) -> None:
    """Write a line of text on a picture (height, width, 3), BGR.

    `at` is the left end of its base line (x, y) and `size` its height, in pixels.
    """
    cv2.putText(canvas, text, at, colour, _FONT, size, weight)


def write_right(
    canvas: np.ndarray, text: str, at: tuple[int, int], colour: Colour = INK, size: int = 16
) -> None:
    """Write a line of text whose base line ends at `at` (x, y) [px]."""
    cv2.putText(canvas, text, at, colour, _FONT, size, REGULAR, cv2.PUT_TEXT_ALIGN_RIGHT)
