"""Darkening of an image towards its corners by the lens."""

from solver.instrument.arrays import Floats


def relative_illumination(
    columns: Floats, rows: Floats, shape: tuple[int, int], darker: float
) -> Floats:
    """Compute the fraction of the light that the lens transmits to pixels of an image.

    `shape` is (height, width). `darker` is the fraction that is lost in the corners; the loss grows
    with the square of the distance from the middle.
    """
    height, width = shape
    across, down = columns - (width - 1) / 2, rows - (height - 1) / 2
    corner_squared = (width**2 + height**2) / 4
    return 1 - darker * (across**2 + down**2) / corner_squared
