"""Fisher information of one image on everything that its image of the beam depends on.

A place on the beam's image informs on its position across the beam, on the brightness of beam and
background, and on the beam's width (`profile`). The position depends on contact, clamp, beam and
camera (`image_shape`). The sum over all visible places is the information of the image.
"""

from collections.abc import Callable
from typing import Final, NamedTuple

import numpy as np

from solver.instrument.arrays import Floats
from vbaa_bench.limits.image_shape import ImageShape
from vbaa_bench.limits.named_information import Information
from vbaa_bench.limits.profile import (
    BACKGROUND,
    BRIGHTNESS,
    SHIFT,
    STEP,
    WIDTH,
    SurfaceProfile,
    gray_profile,
)

# Relative changes of the whole beam's brightness, the background's, and the beam's width. They
# follow the parameters of the image's shape.
APPEARANCE: Final = ("brightness", "background", "width")


class PlacesInformation(NamedTuple):
    """Information of the visible places on the beam's image.

    `of_length` (n, 4, 4) is that of one pixel of the length at n places, see `profile.information`,
    times their visible fraction. `of_tip` [1/px^2] is that on the position of the beam's end along
    its image, see `tip.tip_information`, 0 if it cannot be seen.
    """

    of_length: Floats
    of_tip: float = 0.0


def frame_information(shape: ImageShape, of_places: PlacesInformation) -> Information:
    """Compute the information on the parameters of a shape and on APPEARANCE."""
    parameters, places = shape.across.shape
    change = np.zeros((places, 4, parameters + len(APPEARANCE)))
    change[:, SHIFT, :parameters] = shape.across.T
    change[:, WIDTH, :parameters] = shape.wider.T
    for column, row in enumerate((BRIGHTNESS, BACKGROUND, WIDTH)):
        change[:, row, parameters + column] = 1.0
    weighted = shape.steps[:, None, None] * of_places.of_length
    total = np.einsum("nap,nab,nbq->pq", change, weighted, change, optimize=True)
    along = np.append(shape.tip_along, np.zeros(len(APPEARANCE)))
    total += of_places.of_tip * np.outer(along, along)
    return Information((*shape.names, *APPEARANCE), total)


def edge_information(
    dark: float,
    light: Floats,
    normal: Floats,
    point_spread: float,
    variance: Callable[[Floats], Floats],
) -> Floats:
    """Compute the information (n,) [1/px^2] of a pixel's length of an edge on its position.

    `dark` and `light` (n,) are the radiances beside it, `normal` (2,) is across it.
    """
    # The side of a wide strip of constant radiance.
    edge = gray_profile(SurfaceProfile(np.ones(3), 0.0, 20.0, normal, point_spread))
    side = edge.offset > 0
    contrast = (light - dark)[:, None]
    slopes = edge.slopes[SHIFT][side] * contrast
    return np.asarray((slopes**2 / variance(dark + edge.mean[side] * contrast)).sum(axis=1) * STEP)
