"""Image of the fitted beam of a photograph, for pictures."""

from typing import NamedTuple

import numpy as np

from solver.beams.beam import S_C
from solver.beams.curve import END, P, U
from solver.beams.dead_load import turn_of
from solver.instrument.arrays import Floats
from solver.instrument.transforms import turn_about_z
from solver.photographs.bent_beam import tip_place
from solver.photographs.fit import PhotosFit
from solver.photographs.view import images_of


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
    curve = bent.shape.curve
    lever, height, angle = curve.base
    # Ahead of the load the nodes are at equal arc lengths, to beyond the tip.
    ahead = curve.contact - np.arange(curve.nodes.shape[1])
    before_tip = bent.q[S_C] + (END - bent.q[S_C]) * ahead / curve.contact < 1
    nodes = curve.nodes[:, before_tip]
    along, across = lever - nodes[U], nodes[P] - height
    turn = angle + float(turn_of(bent.shape, bent.q).value)
    rotation = turn_about_z(turn)[:2, :2]
    tip = tip_place(bent.shape, bent.q, own.beam.parameters.span("bow")).value
    places = np.vstack([tip, np.column_stack([along, across]) @ rotation.T])
    images = images_of(places * [1.0, own.side], p[own.view])
    assert images is not None
    load = 1 + int(np.count_nonzero(before_tip[: curve.contact]))
    return Line(images.pixels, images.pixels[load] if own.load else None)
