"""Picture of one frame: the image and its contact enlarged, truth and estimates drawn, a table."""

from collections.abc import Sequence
from typing import Final

import cv2
import numpy as np

from solver.instrument.arrays import Floats
from vbaa_bench.report.gallery import TRUTH, Colours, close_up, strip
from vbaa_bench.report.numbers import short
from vbaa_bench.viewer.ellipses import AXES, HALF, TICKS, EllipsePlot
from vbaa_bench.viewer.frames import Row, ViewedFrame

Colour = tuple[int, int, int]
# BGR. Chosen: black and white are in the palette of OpenCV's GIFs, which dithers other grays.
PAPER: Final = (0, 0, 0)
INK: Final = (255, 255, 255)
FAINT: Final = (160, 152, 145)
BOLD, REGULAR = 600, 400
_FONT: Final = cv2.FontFace("sans")
# Largest size of the image within the picture [px], and side of the plot of errors and of the
# enlarged contact. Chosen: the picture fits a screen of 1280 x 1024 px.
_WIDTH, _HEIGHT = 1200, 620
_SIDE: Final = 318
_MARGIN, _LINE, _HEAD = 14, 26, 44
# Right ends of the table's columns [px].
_COLUMNS: Final = (275, 345, 440, 510)
_HEADS: Final = ("x_c, mm", "±", "force, mN", "±")
# The rim of the plot of errors, in divisions beyond the ends of the axes.
_RIM: Final = 0.3
_BITS: Final = 4  # of a fraction of a pixel


def draw_frame(frame: ViewedFrame, colours: Colours, plot: EllipsePlot) -> np.ndarray:
    """Draw a frame (height, width, 3), BGR; all frames of a dataset have the same size.

    The truth is green: the centreline on both sides of the beam, the contact as a cross. Estimated
    contacts are rings on the true centreline, in the colours of the methods. `plot` has the scales
    of the plot of errors, in which nothing is drawn without estimates.
    """
    image = drawn_image(frame, colours, (_WIDTH, _HEIGHT), margin_px=max(frame.image.shape))
    height, width = image.shape[:2]
    rows = max(_SIDE, _LINE * (len(colours) + 3)) + 2 * _MARGIN
    canvas = np.full((_HEAD + height + rows, max(width, _WIDTH), 3), PAPER, np.uint8)
    canvas[_HEAD : _HEAD + height, (canvas.shape[1] - width) // 2 :][:, :width] = image
    write(canvas, frame.title, (_MARGIN, 30), size=20, weight=BOLD)
    write_right(canvas, f"frame {frame.number}", (canvas.shape[1] - _MARGIN, 30), FAINT)
    top = _HEAD + height + _MARGIN
    _table(canvas, frame, colours, top)
    enlarged = cv2.resize(
        close_up(frame.overlay, colours), (_SIDE, _SIDE), interpolation=cv2.INTER_AREA
    )
    left = canvas.shape[1] - _SIDE - _MARGIN
    canvas[top : top + _SIDE, left : left + _SIDE] = enlarged
    left -= _SIDE + _MARGIN
    if colours:
        canvas[top : top + _SIDE, left : left + _SIDE] = _error_panel(frame, colours, plot, _SIDE)
    return canvas


def drawn_image(
    frame: ViewedFrame, colours: Colours, limits: tuple[int, int], margin_px: int
) -> np.ndarray:
    """Draw on the rows of the image from a margin above the beam to one below it; in BGR.

    These rows (height, width, 3) are enlarged by a whole factor, or reduced, to a width and height
    of at most `limits`.
    """
    height, width = frame.image.shape
    scale = int(max(min(limits[0] // width, limits[1] // height), 1))
    image = strip(frame.overlay, colours, scale, margin_px)
    factor = min(limits[0] / image.shape[1], limits[1] / image.shape[0])
    if factor >= 1:
        return image
    size = (round(image.shape[1] * factor), round(image.shape[0] * factor))
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA))


def _table(canvas: np.ndarray, frame: ViewedFrame, colours: Colours, top: int) -> None:
    """Write truth and estimates, a line per method."""
    base = top + 16
    for right, head in zip(_COLUMNS, _HEADS, strict=True):
        write_right(canvas, head, (right, base), FAINT)
    true = (frame.row["x_c_mm"], None, frame.row["force_n"], None)
    _line(canvas, base + _LINE, "true", TRUTH, true, "no contact")
    for number, (method, colour) in enumerate(colours.items()):
        row: Row = frame.estimates.get(method, {})
        names = ("x_c_mm", "x_c_sigma_mm", "force_n", "force_sigma_n")
        values = [row.get(name) for name in names]
        outcome = row.get("outcome", "no prediction")
        _line(canvas, base + (number + 2) * _LINE, method, colour, values, outcome)


def _line(
    canvas: np.ndarray,
    base: int,
    name: str,
    colour: Colour,
    values: Sequence[float | None],
    outcome: str,
) -> None:
    cv2.circle(canvas, (_MARGIN + 6, base - 5), 6, colour, -1, cv2.LINE_AA)
    write(canvas, name, (_MARGIN + 22, base), INK)
    formats = zip(_COLUMNS, values, (5, 2, 4, 2), (1, 1, 1e3, 1e3), strict=True)
    for right, value, digits, factor in formats:
        if value is not None:
            write_right(canvas, short(factor * value, digits), (right, base), INK)
    if all(value is None for value in values):
        write_right(canvas, outcome, (_COLUMNS[-1], base), FAINT)


def _error_panel(
    frame: ViewedFrame, colours: Colours, plot: EllipsePlot, side_px: int
) -> np.ndarray:
    """Draw the errors of x_c and force in a square (side_px, side_px, 3), BGR.

    An estimate beyond the rim is not drawn, but its ellipse may reach into the panel.
    """
    panel = np.full((side_px, side_px, 3), PAPER, np.uint8)
    for line in (*TICKS, *AXES):
        _plotted(panel, np.array(line), FAINT)
    for method, colour in colours.items():
        row = frame.estimates.get(method)
        placed = None if row is None else plot.place(row, frame.row)
        if placed is None:
            continue
        if placed.ellipse is not None:
            _plotted(panel, placed.ellipse, colour)
        if np.abs(placed.point).max() <= HALF + _RIM:
            ((u, v),) = _place(placed.point[None], side_px)
            cv2.circle(panel, (int(u), int(v)), 4 << _BITS, colour, -1, cv2.LINE_AA, _BITS)
    middle = side_px // 2
    write(panel, f"force +{HALF * plot.force_pct:g} %", (middle + 10, 20), FAINT, 14)
    write_right(panel, f"x_c +{HALF * plot.x_c_mm:g} mm", (side_px - 4, middle + 26), FAINT, 14)
    return panel


def _plotted(panel: np.ndarray, points: Floats, colour: Colour) -> None:
    path = [_place(points, panel.shape[0])]
    cv2.polylines(panel, path, False, colour, 1, cv2.LINE_AA, _BITS)


def _place(points: Floats, side_px: int) -> np.ndarray:
    """Convert divisions (n, 2), right and down, to fractions of pixels; far ones are cut off."""
    scale = side_px / (2 * (HALF + _RIM))
    # OpenCV's fractions of pixels overflow beyond 2^27.
    pixels = np.clip(side_px / 2 + scale * np.asarray(points), -1e5, 1e5)
    return np.asarray(np.rint(pixels * 2**_BITS), np.int32)


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
