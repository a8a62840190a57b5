"""Calibration targets drawn in numpy, without meshes or rays: a road of its own to their images."""

from functools import cache

import cv2
import numpy as np
import numpy.typing as npt

from solver.instrument.arrays import Floats, Grey
from solver.instrument.board import Board, Charuco, LineNetwork
from solver.instrument.camera import Camera
from solver.instrument.transforms import invert, rigid

WHITE, BLACK = 0.7, 0.04


class OldCharuco(Charuco):
    """A board as OpenCV drew it before version 4.6."""


def drawn(
    board: Board,
    camera: Camera,
    antenna_from_board: Floats,
    random: np.random.Generator,
    *,
    noise: float = 0.004,
    blur_px: float = 0.5,
    bits: int = 8,
    samples: int = 89,
    generator: int = 55,
) -> Grey:
    """The view of a board (height, width): a mean over subpixels, blurred, shaded, with noise.

    The subpixels are a Fibonacci lattice: an edge along a row of pixels crosses 89 levels in turn,
    and not eight at a time as on a square grid of as many.
    """
    u, v = np.meshgrid(np.arange(camera.width + 1) - 0.5, np.arange(camera.height + 1) - 0.5)
    pixels = np.column_stack([u.ravel(), v.ravel()])
    # Within a pixel the lens is linear, to a hundred-thousandth of a pixel.
    ideal = camera.normalised(pixels).reshape(camera.height + 1, camera.width + 1, 2)
    mean = np.zeros((camera.height, camera.width))
    board_from_camera = invert(camera.camera_from_antenna @ antenna_from_board)
    for number in range(samples):
        a, b = (number + 0.5) / samples, (number * generator % samples + 0.5) / samples
        left = (1 - a) * ideal[:-1] + a * ideal[1:]
        sampled = (1 - b) * left[:, :-1] + b * left[:, 1:]
        mean += reflectance(board, _on_board(sampled, board_from_camera, camera.telecentric))
    mean /= samples
    shaded: Floats = (
        mean * np.linspace(0.9, 1.1, camera.width) * np.linspace(1.05, 0.85, camera.height)[:, None]
    )
    if blur_px:
        shaded = np.asarray(cv2.GaussianBlur(shaded, (0, 0), blur_px), np.float64)
    noisy = np.clip(shaded + noise * random.standard_normal(shaded.shape), 0, 1)
    whole = np.rint(noisy * (2**bits - 1))
    return np.asarray(whole, np.uint8) if bits == 8 else np.asarray(whole, np.uint16)


def tilted(antenna_from_board: Floats, number: int, away: float, tilt: float = 0.4) -> Floats:
    """Pose of the board in view `number`: leaning another way each time, `away` [m] lower."""
    compass = 2.4 * number
    axis = np.array([np.cos(compass), np.sin(compass), 0.0])
    return antenna_from_board @ rigid(tilt * axis, np.array([0.0, 0.0, -away]))


def _on_board(normalised: Floats, board_from_camera: Floats, telecentric: bool) -> Floats:
    """Where rays (..., 2) meet the board's plane (..., 2) [m]."""
    rotation, eye = board_from_camera[:3, :3], board_from_camera[:3, 3]
    x, y = normalised[..., 0], normalised[..., 1]
    moved = [axis[0] * x + axis[1] * y for axis in rotation]
    start = [at + by for at, by in zip(eye, moved, strict=True)] if telecentric else eye
    ray = (
        rotation[:, 2]
        if telecentric
        else [by + axis[2] for by, axis in zip(moved, rotation, strict=True)]
    )
    far = start[2] / ray[2]
    return np.stack([start[0] - ray[0] * far, start[1] - ray[1] * far], axis=-1)


def reflectance(board: Board, points: Floats) -> Floats:
    """White or black (...,) at points (..., 2) [m] of the card; 0 beside it."""
    x = points[..., 0] / board.square
    y = -points[..., 1] / board.square  # downward, in squares
    card = (np.abs(x) < (board.columns + 3) / 2) & (np.abs(y) < (board.rows + 3) / 2)
    if isinstance(board, LineNetwork):
        dark = _inked(board, x, y)
    else:
        across, down = x + (board.columns + 1) / 2, y + (board.rows + 1) / 2
        inside = (
            (across >= 0) & (across < board.columns + 1) & (down >= 0) & (down < board.rows + 1)
        )
        column, row = np.floor(across).astype(int), np.floor(down).astype(int)
        dark = inside & ((column + row) % 2 == 0)
        if isinstance(board, Charuco):
            print_ = _charuco_print(board)
            bit_x = np.clip(np.floor(across * 10).astype(int), 0, print_.shape[1] - 1)
            bit_y = np.clip(np.floor(down * 10).astype(int), 0, print_.shape[0] - 1)
            dark = inside & (print_[bit_y, bit_x] == 0)
    return np.where(card, np.where(dark, BLACK, WHITE), 0.0)


def _inked(board: LineNetwork, x: Floats, y: Floats) -> npt.NDArray[np.bool_]:
    on_line = []
    for along, across, columns, rows, thick in (
        (y, x, board.columns, board.rows, board.thick_column),
        (x, y, board.rows, board.columns, board.thick_row),
    ):
        number = np.clip(np.rint(across + (columns - 1) / 2), 0, columns - 1)
        off = np.abs(across - (number - (columns - 1) / 2))
        half = np.where(number == thick, 1.0, 0.5) * board.line_width / board.square
        on_line.append((off < half) & (np.abs(along) < rows / 2))
    return np.asarray(on_line[0] | on_line[1])


@cache
def _charuco_print(board: Charuco) -> npt.NDArray[np.uint8]:
    """OpenCV's own picture of the board, ten pixels a square."""
    dictionary = cv2.aruco.getPredefinedDictionary(
        getattr(cv2.aruco, f"DICT_{board.dictionary.upper()}")
    )
    size = (board.columns + 1, board.rows + 1)
    printed = cv2.aruco.CharucoBoard(size, 1.0, 0.6, dictionary)
    printed.setLegacyPattern(isinstance(board, OldCharuco))
    return np.asarray(printed.generateImage((size[0] * 10, size[1] * 10)), dtype=np.uint8)
