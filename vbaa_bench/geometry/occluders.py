"""Thin opaque bodies that hide the beam from the camera, in Sigma_a, lengths in [m].

All are spread over a rectangle in x and y, at a height z above the beam, towards the camera.
"""

import numpy as np
import trimesh

from solver.instrument.errors import InputError
from solver.instrument.transforms import rigid, turn_about_z
from solver.instrument.units import DEGREE, MILLIMETRE
from vbaa_bench.geometry.solids import box, prism, together

# Default thickness of all of them.
THICKNESS = 0.2 * MILLIMETRE

# Width of a leaf over its size, and its largest tilt [rad].
LEAF_WIDTH, MAX_TILT = 0.4, 15 * DEGREE


def sheet_over(
    x_from: float,
    x_to: float,
    y_from: float,
    y_to: float,
    height: float,
    thickness: float = THICKNESS,
) -> trimesh.Trimesh:
    """Mesh an opaque sheet that covers the rectangle; its underside is at `height`."""
    return box(np.array([x_from, y_from, height]), np.array([x_to, y_to, height + thickness]))


def bars(
    x_from: float,
    x_to: float,
    y_from: float,
    y_to: float,
    height: float,
    count: int,
    width: float,
    thickness: float = THICKNESS,
) -> trimesh.Trimesh:
    """Mesh bars along y, evenly spread from x_from to x_to, each with half a gap on both sides.

    Raises InputError if `count` bars of that width do not fit side by side.
    """
    pitch = (x_to - x_from) / count
    if not width < pitch:
        raise InputError(
            f"{count} bars are {width / MILLIMETRE:g} mm wide,"
            f" allowed is less than their pitch, {pitch / MILLIMETRE:g} mm"
        )
    starts = x_from + pitch * (np.arange(count) + 0.5) - width / 2
    meshes = [sheet_over(x, x + width, y_from, y_to, height, thickness) for x in starts]
    return together(meshes)


def leaves(
    x_from: float,
    x_to: float,
    y_from: float,
    y_to: float,
    height: float,
    count: int,
    size: float,
    random: np.random.Generator,
    thickness: float = THICKNESS,
) -> trimesh.Trimesh:
    """Mesh pointed leaves, `size` long, with random centres in the rectangle at `height`.

    They have random headings and small tilts: none reaches deeper below `height` than half its
    size times the sine of MOST_LEAN, plus half its thickness.
    """
    t = np.linspace(0, 1, 13)
    along, half_width = size * (t - 0.5), LEAF_WIDTH / 2 * size * np.sin(np.pi * t)
    below = np.column_stack([along, -half_width])[:-1]
    above = np.column_stack([along, half_width])[:0:-1]
    leaf = prism(np.vstack([below, above]), -thickness / 2, thickness / 2)
    meshes = []
    for x, y, heading, azimuth, tilt in random.uniform(
        [x_from, y_from, 0, 0, 0], [x_to, y_to, 2 * np.pi, 2 * np.pi, MAX_TILT], (count, 5)
    ):
        rotation = tilt * np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
        placed = leaf.copy()
        placed.apply_transform(rigid(rotation, np.array([x, y, height])) @ turn_about_z(heading))
        meshes.append(placed)
    return together(meshes)
