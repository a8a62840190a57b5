"""Displacement of the points of a beam by a change of a parameter, in space.

A change of the camera moves the image and leaves the beam where it is. Here the beam moves instead,
at the same depth, so that its light stays the same.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from solver.instrument.arrays import Floats
from solver.instrument.transforms import apply, invert
from vbaa_bench.limits.imaged_beam import ImagedBeam, Neighbours


class Displacements(NamedTuple):
    """Change of the n points of the centreline at FRACTIONS with p parameters.

    `metres` (p, n, 3) is in the frame in which the camera is fixed, per SI unit of each parameter;
    `largest_px` (p,) is the length in the image of the longest of them, per SI unit.
    """

    metres: Floats
    largest_px: Floats


def displacements(imaged: ImagedBeam, neighbours: Mapping[str, Neighbours]) -> Displacements:
    """Differentiate the places of a beam by parameters. Raises EquilibriumError."""
    metres, largest_px = [], []
    for one in neighbours.values():
        ahead, behind = (_places(imaged, changed) for changed in (one.ahead, one.behind))
        in_image = imaged.camera.project(ahead) - imaged.camera.project(behind)
        metres.append((ahead - behind) / one.difference)
        largest_px.append(float(np.linalg.norm(in_image, axis=1).max()) / one.difference)
    return Displacements(np.array(metres), np.array(largest_px))


def _places(imaged: ImagedBeam, changed: ImagedBeam) -> Floats:
    """Compute points (n, 3) [m] that the unchanged camera sees where a changed one sees a beam."""
    camera = imaged.camera
    points = apply(changed.frame_from_clamp, changed.beam.centreline[:, 1:])
    if changed.camera is camera:
        return points
    depth = apply(camera.camera_from_antenna, points)[:, 2:]
    ideal = camera.normalised(changed.pixels)
    across = ideal if camera.telecentric else ideal * depth
    return apply(invert(camera.camera_from_antenna), np.hstack([across, depth]))
