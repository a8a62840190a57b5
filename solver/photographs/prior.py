"""Prior of the parameters of photographs: what is stated, and what is assumed."""

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from solver.instrument.arrays import Floats, Mask
from solver.instrument.beam_shape import BOW, CLAMP_SHIFT, FIRST_WIDTH, SOFTNESS
from solver.photographs.photo_set import PhotoSet, Stated
from solver.photographs.problem import OWN, PhotoProblem, shared_parameters
from solver.photographs.view import VIEW_A, VIEW_B

# Focal length over the image's diagonal, and its relative sigma. Chosen: from the wide to the
# narrow camera of a telephone, and cameras with a lens of 28 to 50 mm for the 35 mm format.
_FOCAL: Final = Stated(0.75, 0.25)
# Bow and sag of a beam of which neither is stated: each coefficient of the bow, and the sag of the
# tip under the own weight, over the length. Chosen: the tip of a beam of 400 mm is 8 mm off its
# tangent, and a thin one sags by 40 mm. Photographs at rest determine both.
_BOW_SIGMA, _SAG_SIGMA = 0.02, 0.1
# Line of a uniform beam under its own weight, of which the tip sags by 1: 2 s^2 - 4/3 s^3 + s^4/3.
_SAG: Final = np.array([2.0, -4 / 3, 1 / 3])
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


def line_at_rest(bow_sigma: float) -> Floats:
    """Return the covariance (3, 3) of a bow whose tip has this sigma, over the length.

    Infinite, it is that of an assumed bow and an assumed sag under the own weight.
    """
    if math.isfinite(bow_sigma):
        return np.eye(BOW) * bow_sigma**2 / BOW
    return np.eye(BOW) * _BOW_SIGMA**2 + np.outer(_SAG, _SAG) * _SAG_SIGMA**2


def prior_of(photos: PhotoSet, problems: Sequence[PhotoProblem], diagonal: float) -> Prior:
    """Return the prior of the shared parameters and of those of each photograph.

    Without a stated EI, it is open if a force is known, and fixed else: a unit of force.
    """
    shape, at = photos.shape, shared_parameters(len(photos.shape.widths))
    size = len(at) + len(OWN) * len(problems)
    mean, covariance, open_ = np.zeros(size), np.zeros((size, size)), np.zeros(size, np.bool_)
    focal = focal_of(photos, diagonal)
    mean[at["focal"]], mean[at["k1"]] = math.log(focal.value), photos.k1.value
    sigmas = {
        "rigidity": photos.rigidity.sigma / photos.rigidity.value if photos.rigidity else 0.0,
        "down": photos.down.sigma,
        "focal": focal.sigma / focal.value,
        "k1": photos.k1.sigma,
    }
    for name, sigma in sigmas.items():
        covariance[at[name], at[name]] = sigma**2
    known = any(problem.load and problem.load.force for problem in problems)
    open_[at["rigidity"]] = photos.rigidity is None and known
    # The marks locate the clamp, and the loads' plane is that of the image.
    used = [SOFTNESS, CLAMP_SHIFT, *range(FIRST_WIDTH, len(shape.covariance))]
    rows = at.indices("softness", "clamp_shift", "widths", "bow")[: len(used)]
    mean[rows] = [shape.softness, shape.clamp_shift, *shape.widths, *shape.bow]
    covariance[np.ix_(rows, rows)] = shape.covariance[np.ix_(used, used)]
    # The stated length is that from the clamp to the tip.
    length, shift = at["length"], at["clamp_shift"]
    mean[length] = -mean[shift]
    covariance[length] = covariance[:, length] = -covariance[shift]
    covariance[length, length] = covariance[shift, shift]
    covariance[length, length] += (photos.length.sigma / photos.length.value) ** 2
    if not len(shape.bow):
        bow = at.span("bow")
        covariance[bow, bow] = line_at_rest(shape.bow_sigma)
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
