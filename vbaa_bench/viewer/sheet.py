"""Contact sheet: many frames in one picture, each with the truth and the estimates."""

from typing import Final

import cv2
import numpy as np

from vbaa_bench.report.gallery import Colours, colours_of
from vbaa_bench.report.numbers import signed
from vbaa_bench.viewer.animation import Progress
from vbaa_bench.viewer.drawn_frame import BOLD, FAINT, INK, PAPER, drawn_image, write
from vbaa_bench.viewer.frames import ViewedDataset, ViewedFrame

# Chosen: a sheet for a screen, on which the rings of the estimates are distinct.
MAX_TILES: Final = 30
_COLUMNS, _WIDTH, _GAP = 3, 520, 12
_HEAD, _CAPTION, _LINE = 40, 26, 20
# Rows of the image above and below the beam. Chosen: the object is in view.
_ABOVE_PX: Final = 60
# Errors in a line of a tile's caption. Chosen: of three, those with long names touched.
_PER_LINE: Final = 2


def contact_sheet(data: ViewedDataset, progress: Progress) -> bytes:
    """Draw frames as a PNG; of more than 30 frames, 30 that are evenly spaced."""
    colours = colours_of(list(data.predictions))
    chosen = set(np.linspace(0, len(data) - 1, min(len(data), MAX_TILES)).round().astype(int))
    tiles = []
    for number, frame in enumerate(data):
        if number in chosen:
            tiles.append(_tile(frame, colours))
        progress(number + 1)
    columns = min(_COLUMNS, len(tiles))
    height, width = max(tile.shape[0] for tile in tiles), _WIDTH + _GAP
    rows = -(-len(tiles) // columns)
    sheet = np.full((_HEAD + rows * (height + _GAP), columns * width + _GAP, 3), PAPER, np.uint8)
    for number, tile in enumerate(tiles):
        row, column = divmod(number, columns)
        top, left = _HEAD + row * (height + _GAP), _GAP + column * width
        sheet[top : top + len(tile), left : left + _WIDTH] = tile
    _legend(sheet, colours)
    success, content = cv2.imencode(".png", sheet, [cv2.IMWRITE_PNG_COMPRESSION, 9])
    assert success
    return bytes(content)


def _tile(frame: ViewedFrame, colours: Colours) -> np.ndarray:
    """Draw a frame with its errors of x_c below."""
    image = drawn_image(frame, colours, (_WIDTH, _WIDTH), _ABOVE_PX)
    height, width = image.shape[:2]
    lines = -(-len(colours) // _PER_LINE)
    tile = np.full((_CAPTION + height + lines * _LINE + 6, _WIDTH, 3), PAPER, np.uint8)
    write(tile, frame.title, (2, 18), INK, 15, BOLD)
    tile[_CAPTION : _CAPTION + height, :width] = image
    for number, (method, colour) in enumerate(colours.items()):
        row, column = divmod(number, _PER_LINE)
        at = (2 + column * _WIDTH // _PER_LINE, _CAPTION + height + (row + 1) * _LINE - 3)
        write(tile, f"{method} {_error(frame, method)}", at, colour, 13)
    return tile


def _error(frame: ViewedFrame, method: str) -> str:
    """Write the error of x_c, or the outcome of an estimate without x_c."""
    row = frame.estimates.get(method)
    if row is None:
        return "–"
    estimate, true = row["x_c_mm"], frame.row["x_c_mm"]
    if estimate is None or true is None:
        return str(row["outcome"])
    return f"{signed(estimate - true)} mm"


def _legend(sheet: np.ndarray, colours: Colours) -> None:
    text = "true beam and contact (cross); estimated contacts (rings), with the errors of x_c"
    write(sheet, text if colours else "true beam and contact (cross)", (_GAP, 27), FAINT, 16)
