"""Prior of the parameters of photographs: what is stated, and what is assumed."""

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from solver.instrument.arrays import Floats, Mask
from solver.instrument.beam_shape import FIRST_WIDTH, SOFTNESS
from solver.photographs.photo_set import PhotoSet, Stated
from solver.photographs.problem import OWN, PhotoProblem, shared_parameters
from solver.photographs.view import VIEW_A, VIEW_B

# Focal length over the image's diagonal, and its relative sigma. Chosen: from the wide to the
# narrow camera of a telephone, and cameras with a lens of 28 to 50 mm for the 35 mm format.
_FOCAL: Final = Stated(0.75, 0.25)
# Chosen: 4 % of the radius in the corner of a wide image; telephones correct most of it.
_K1_SIGMA: Final = 0.1
# Each coefficient of the bow. Chosen: the tip of a beam of 400 mm is 8 mm off its tangent.
_BOW_SIGMA: Final = 0.02
# Place of the load over the length. Chosen: it is on the beam.
_PLACE: Final = Stated(0.5, 1.0)


class Prior(NamedTuple):
    """Mean (p,) and covariance (p, p) of all parameters, and which of them have no prior (p,).

    A parameter that is not `open` and has no variance is fixed.
    """

    mean: Floats
    covariance: Floats
    open: Mask


def nominal_rigidity(photos: PhotoSet) -> float:
    """Return the stated EI [N m^2], or a unit of it."""
    return 1.0 if photos.rigidity is None else photos.rigidity.value


def focal_of(photos: PhotoSet, diagonal: float) -> Stated:
    """Return the focal length [px], stated or assumed for an image of this diagonal [px]."""
    assumed = Stated(_FOCAL.value * diagonal, _FOCAL.value * _FOCAL.sigma * diagonal)
    return photos.focal or assumed


def prior_of(photos: PhotoSet, problems: Sequence[PhotoProblem], diagonal: float) -> Prior:
    """Return the prior of the shared parameters and of those of each photograph.

    Without a stated EI, it is open if a force is known, and fixed else: a unit of force.
    """
    shape, at = photos.shape, shared_parameters(len(photos.shape.widths))
    size = len(at) + len(OWN) * len(problems)
    mean, covariance, open_ = np.zeros(size), np.zeros((size, size)), np.zeros(size, np.bool_)
    focal = focal_of(photos, diagonal)
    mean[at["focal"]] = math.log(focal.value)
    sigmas = {
        "rigidity": photos.rigidity.sigma / photos.rigidity.value if photos.rigidity else 0.0,
        "length": photos.length.sigma / photos.length.value,
        "down": photos.down.sigma,
        "focal": focal.sigma / focal.value,
        "k1": _K1_SIGMA,
    }
    for name, sigma in sigmas.items():
        covariance[at[name], at[name]] = sigma**2
    known = any(problem.load and problem.load.force for problem in problems)
    open_[at["rigidity"]] = photos.rigidity is None and known
    # The marks locate the clamp, and the loads' plane is that of the image.
    used = [SOFTNESS, *range(FIRST_WIDTH, len(shape.covariance))]
    rows = at.indices("softness", "widths", "bow")[: len(used)]
    mean[rows] = [shape.softness, *shape.widths, *shape.bow]
    covariance[np.ix_(rows, rows)] = shape.covariance[np.ix_(used, used)]
    if not len(shape.bow):
        bow = at.indices("bow")
        covariance[bow, bow] = _BOW_SIGMA**2
    for i, problem in enumerate(problems):
        first = len(at) + len(OWN) * i
        load, place, friction, tilt, view = (first + OWN[name] for name, _ in OWN.blocks)
        if problem.load:
            open_[load] = True
            mean[place], covariance[place, place] = _PLACE.value, _PLACE.sigma**2
        if problem.load and problem.load.kind == "push":
            covariance[friction, friction] = shape.ratio_sigma**2
        covariance[tilt, tilt] = photos.tilt_sigma**2
        open_[view : view + VIEW_A] = True
        for angle in (view + VIEW_A, view + VIEW_B):
            covariance[angle, angle] = photos.view_sigma**2
    return Prior(mean, covariance, open_)
