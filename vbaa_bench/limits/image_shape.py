"""Image of the beam: its change with parameters, and the Fisher information of one image on them.

A place on the beam's image informs on its position across the beam, on the brightness of beam and
background, and on the beam's width (`profile`). The position depends on contact, clamp, beam and
camera (`imaged_beam`). A measurement of the centreline shows only the change across the beam's
image; its end shows the change along it. The sum over all visible places is the information of the
image.
"""

from collections.abc import Mapping
from typing import Final, NamedTuple

import numpy as np

from solver.instrument.arrays import Floats
from vbaa_bench.limits.imaged_beam import FRACTIONS, PLACES, ImagedBeam, Neighbours
from vbaa_bench.limits.information import Information
from vbaa_bench.limits.profile import BACKGROUND, BRIGHTNESS, SHIFT, WIDTH

# Relative changes of the whole beam's brightness, the background's, and the beam's width. They
# follow the parameters of the image's shape.
APPEARANCE: Final = ("brightness", "background", "width")


class ImageShape(NamedTuple):
    """Image of the centreline and its change with p parameters, with these `names`.

    `pixels` (n, 2) are places on it and `normals` (n, 2) the unit vectors across it. `steps` (n,)
    [px] are the lengths of the image that the places stand for; their sum is the image's length.
    `across` (p, n) and `tip_along` (p,) are the changes of the places across the image, and of its
    end along it, in [px] per SI unit of each parameter. `wider` (p, n) are the relative changes of
    the magnification, by which a beam that comes nearer looks wider.
    """

    names: tuple[str, ...]
    pixels: Floats
    normals: Floats
    steps: Floats
    across: Floats
    wider: Floats
    tip_along: Floats


def image_shape(imaged: ImagedBeam, neighbours: Mapping[str, Neighbours]) -> ImageShape:
    """Differentiate the image of a beam at the middles of PLACES equal parts of its length.

    Raises EquilibriumError.
    """
    line = imaged.pixels
    tangents = np.gradient(line, FRACTIONS, axis=0)
    lengths = np.linalg.norm(tangents, axis=1)
    tangents = tangents / lengths[:, None]
    normals = np.column_stack([-tangents[:, 1], tangents[:, 0]])
    change = np.array(
        [(one.ahead.pixels - one.behind.pixels) / one.difference for one in neighbours.values()]
    )
    wider = np.array(
        [
            np.log(one.ahead.pixels_per_metre / one.behind.pixels_per_metre) / one.difference
            for one in neighbours.values()
        ]
    )
    inner = slice(1, -1)
    return ImageShape(
        names=tuple(neighbours),
        pixels=line[inner],
        normals=normals[inner],
        steps=lengths[inner] / PLACES,
        across=np.einsum("pni,ni->pn", change, normals)[:, inner],
        wider=wider[:, inner],
        tip_along=change[:, -1] @ tangents[-1],
    )


class PlacesInformation(NamedTuple):
    """Information of the visible places on the beam's image.

    `of_length` (n, 4, 4) is that of one pixel of the length at n places, see `profile.information`,
    times their visible fraction. `of_tip` [1/px^2] is that on the position of the beam's end along
    its image, see `tip.tip_information`, 0 if it cannot be seen.
    """

    of_length: Floats
    of_tip: float = 0.0


def image_information(shape: ImageShape, of_places: PlacesInformation) -> Information:
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
