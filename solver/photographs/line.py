"""Image of the fitted beam of a photograph, for pictures."""

from typing import Final, NamedTuple

import numpy as np

from solver.beams.beam import S_C
from solver.instrument.arrays import Floats
from solver.photographs.bent_beam import places_on
from solver.photographs.fit import PhotosFit
from solver.photographs.view import images_of

# Places of the line, over the length. Chosen: the eye sees no corners.
_PLACES: Final = np.linspace(1, 0, 41)


class Line(NamedTuple):
    """Pixels (n, 2) of the beam from the tip to the clamp, relative to the principal point.

    `load` (2,) is that of the load, None at rest.
    """

    pixels: Floats
    load: Floats | None


def fitted_line(fit: PhotosFit, photo: int) -> Line:
    """Compute the image of the fitted beam of one photograph of the fit."""
    own = fit.problem.photos[photo]
    p = fit.at.p[fit.problem.columns(photo)]
    bent = own.bent(p)
    assert bent is not None  # the fit's minimum has a shape
    places = places_on(bent.shape, bent.q, np.append(_PLACES, bent.q[S_C]))
    images = images_of(places * [1.0, own.side], p[own.view])
    assert images is not None
    return Line(images.pixels[:-1], images.pixels[-1] if own.load else None)
