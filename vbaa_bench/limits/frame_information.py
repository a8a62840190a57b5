"""Fisher information of one image on everything that its image of the beam depends on.

A place on the beam's image informs on its position across the beam, on the brightness of beam and
background, and on the beam's width (`profile`). The position depends on contact, clamp, beam and
camera (`image_shape`). The sum over all visible places is the information of the image.
"""

from collections.abc import Callable, Sequence
from typing import Final

import numpy as np

from solver.instrument.arrays import Floats
from vbaa_bench.limits.image_shape import ImageShape
from vbaa_bench.limits.profile import (
    BACKGROUND,
    BRIGHTNESS,
    SHIFT,
    STEP,
    WIDTH,
    SurfaceProfile,
    gray_profile,
    information,
)

# Relative changes of the whole beam's brightness, the background's, and the beam's width. They
# follow the parameters of the image's shape.
APPEARANCE: Final = ("brightness", "background", "width")


def frame_information(
    shape: ImageShape,
    surfaces: Sequence[SurfaceProfile],
    variance: Callable[[Floats], Floats],
    visible: Floats,
    *,
    tip_is_visible: bool,
) -> Floats:
    """Compute the information (p + 3, p + 3) on the p parameters of a shape and on APPEARANCE.

    `surfaces` and `visible` (n,), the visible fraction of each place, belong to its n places;
    `variance` maps mean radiances of pixels to those of the sensor's noise.
    """
    parameters, places = shape.across.shape
    total = np.zeros((parameters + len(APPEARANCE),) * 2)
    change = np.zeros((4, parameters + len(APPEARANCE)))
    for row, column in zip((BRIGHTNESS, BACKGROUND, WIDTH), range(3), strict=True):
        change[row, parameters + column] = 1.0
    for i in range(places):
        if visible[i] > 0:
            change[SHIFT, :parameters] = shape.across[:, i]
            of_pixel = information(surfaces[i], variance)
            total += visible[i] * shape.steps[i] * (change.T @ of_pixel @ change)
    if tip_is_visible:
        along = np.append(shape.tip_along, np.zeros(len(APPEARANCE)))
        total += tip_information(surfaces[-1], variance) * np.outer(along, along)
    return total


def tip_information(surface: SurfaceProfile, variance: Callable[[Floats], Floats]) -> float:
    """Compute the information [1/px^2] on the position of the beam's flat end along its image.

    Along the beam the end is an edge between the profile and the background, blurred by a pixel and
    the point spread. As across the beam, sums over pixels are integrals, and the profile across the
    end is the one of the beam.
    """
    profile = gray_profile(surface)
    contrast = profile.mean - surface.background
    # An edge along the beam is the side of a wide strip of constant radiance, turned by 90 degrees.
    along = np.array([-surface.normal[1], surface.normal[0]])
    strip = SurfaceProfile(np.ones(3), 0.0, 20.0, along, surface.point_spread)
    edge = gray_profile(strip)
    side = edge.offset > 0
    cover, slope = edge.mean[side], edge.slopes[SHIFT][side]
    total = 0.0
    for level, weight in zip(cover, slope**2, strict=True):
        mean = surface.background + level * contrast
        total += float((weight * contrast**2 / variance(mean)).sum())
    return total * STEP**2
