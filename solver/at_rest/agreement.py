"""Which images of the beam at rest agree: copies, images of the beam elsewhere, and noise.

Copies of one image count once. An image that shows the beam in another place than the others,
because it was touched or swinging, is left out. Where the beam hardly differs from the ground, its
centre is wherever noise puts it, and images in which nothing moved show it in different places:
their gray values about the beam then differ by noise alone.
"""

import math
from collections.abc import Callable, Sequence
from typing import Final, NamedTuple

import numpy as np

from solver.at_rest.rest_points import centres, place_keys, with_grid_error
from solver.at_rest.thresholds import THRESHOLDS
from solver.centreline import Centreline
from solver.centreline.extractor import Extractor
from solver.centreline.guide import Guide
from solver.centreline.noise import mean_image
from solver.core.correlation import correlation_length
from solver.instrument.arrays import Floats, Grey
from solver.instrument.errors import InputError

# Learns a beam extractor from images of the beam at rest.
Learn = Callable[[Sequence[Grey], Guide], Extractor]

# Terms of a motion of the beam along it. Chosen: a cubic, as of a beam that is touched.
_TERMS: Final = 4
# Pixels beside the beam's edges that are compared. Chosen: a blurred edge is that wide.
_MARGIN_PX: Final = 3


class AgreeingImages(NamedTuple):
    """Distinct images (height, width) that agree, their extractor, and their centrelines.

    `copies` and `rejected` are those of `RestState`.
    """

    images: Sequence[Grey]
    extract: Extractor
    lines: list[Centreline]
    copies: int
    rejected: tuple[int, ...]


def agreeing_images(images: Sequence[Grey], guide: Guide, learn: Learn) -> AgreeingImages:
    """Choose the images (height, width) that agree. Raises InputError where too few of them do."""
    distinct = _distinct(images)
    extract, lines = _learn_extractor(distinct, guide, learn)
    deviations = disagreements(lines)
    outliers = tuple(int(i) for i in np.flatnonzero(deviations))
    if outliers and 2 * len(outliers) < len(distinct):
        used = [image for i, image in enumerate(distinct) if i not in outliers]
        extract, lines = _learn_extractor(used, guide, learn)
        deviations = disagreements(lines)
    else:
        used, outliers = distinct, ()
    largest = float(deviations.max(initial=0.0))
    if largest > THRESHOLDS.max_disagreement_px:
        raise _placing_error(largest, used, lines, guide)
    return AgreeingImages(used, extract, lines, len(images) - len(distinct), outliers)


def _distinct(images: Sequence[Grey]) -> list[Grey]:
    """Return the images without those that equal an earlier one."""
    distinct: list[Grey] = []
    for image in images:
        if not any(np.array_equal(image, earlier) for earlier in distinct):
            distinct.append(image)
    return distinct


def _learn_extractor(
    images: Sequence[Grey], guide: Guide, learn: Learn
) -> tuple[Extractor, list[Centreline]]:
    """Learn the extractor, and extract the centreline of every image. Raises InputError."""
    try:
        extract = learn(images, guide)
    except InputError:
        # Where the camera moved between the images, each of them may show the beam well.
        if len(images) > 1:
            single = learn(images[:1], guide)
            lines = [single(image) for image in images]
            largest = float(disagreements(lines).max(initial=0.0))
            if largest > THRESHOLDS.max_disagreement_px:
                raise _placing_error(largest, images, lines, guide) from None
        raise
    return extract, [extract(image) for image in images]


def disagreements(lines: Sequence[Centreline]) -> Floats:
    """Measure the largest deviation (n,) [px] of each image's beam from the median of all.

    `lines` are the centrelines of n images of the beam at rest. An image that agrees with the
    others within its errors has 0.
    """
    deviations = np.zeros(len(lines))
    # Images of one place have one grid error, and each fit of it an error of its own.
    lines = [with_grid_error(line) for line in lines]
    centre_by_key = [dict(zip(place_keys(line), centres(line), strict=True)) for line in lines]
    keys = sorted(set.intersection(*map(set, centre_by_key)))
    if len(keys) < THRESHOLDS.min_points:
        return deviations
    centre = np.array([[centres[key] for key in keys] for centres in centre_by_key])
    shape = _smooth_terms(len(keys))
    for i, difference in enumerate(centre - np.median(centre, axis=0)):
        smooth = shape @ np.linalg.lstsq(shape, difference)[0]
        residual = difference - smooth
        variance = max(float(np.mean(residual**2)), 1e-12) * correlation_length(residual)
        largest = float(np.abs(smooth).max())
        if (
            smooth @ smooth / variance > THRESHOLDS.disagreement_chi2
            and largest > THRESHOLDS.disagreement_px
        ):
            deviations[i] = largest
    return deviations


def _placing_error(
    largest: float, images: Sequence[Grey], lines: Sequence[Centreline], guide: Guide
) -> InputError:
    """Explain why images (height, width) show the beam `largest` [px] apart, at their `lines`."""
    if moved(images, lines, guide.radius_px):
        return InputError(
            f"the rest images show the beam in different places, up to {largest:.2f} px apart: the "
            "camera or the beam moved, or image stabilisation is on; take them again with both at "
            "rest"
        )
    return InputError(
        f"the contrast of the beam is too low: its places in the rest images are up to "
        f"{largest:.2f} px apart, although nothing in them moved; use a plain ground that is "
        "darker or brighter than the beam, more light, or a sharper focus"
    )


def moved(images: Sequence[Grey], lines: Sequence[Centreline], radius_px: float) -> bool:
    """Return whether the beam or the camera moved between images (height, width) of a beam at rest.

    `lines` are the beam's centrelines as found in the images, each of at least `min_points`. The
    difference of an image from the mean of all is fitted, along its line, by a smooth motion: the
    mean's gradient across the beam, times a cubic of the place along the beam. Changes of
    brightness are fitted, too. The motion counts if it is significant and large enough, both as
    for the places of the lines.
    """
    mean = mean_image(images)
    half = math.ceil(2 * radius_px) + _MARGIN_PX
    return any(
        _significant(np.asarray(image, np.float64) - mean, mean, line, half)
        for image, line in zip(images, lines, strict=True)
    )


def _significant(difference: Floats, mean: Floats, line: Centreline, half: int) -> bool:
    """Return whether a difference (height, width) from the mean image is that of a motion."""
    along = np.rint(line.directions).astype(np.int64)
    centre = np.rint(line.points).astype(np.int64)
    # Pixels (n, 2 half + 1, 2) across the beam, those at the border with their own neighbours.
    pixels = centre[:, None] + along[:, None] * np.arange(-half, half + 1)[:, None]
    highest = np.array(mean.shape[::-1]) - 1
    values, before, after = (
        mean[tuple(np.clip(pixels + step * along[:, None], 0, highest).T[::-1])].T
        for step in (0, -1, 1)
    )
    changes = difference[tuple(np.clip(pixels, 0, highest).T[::-1])].T
    shape = _smooth_terms(len(centre))
    gradient = (after - before) / 2
    motion = -(gradient[..., None] * shape[:, None]).reshape(-1, _TERMS)
    light = np.column_stack([values.ravel(), np.ones(values.size)])
    design = np.column_stack([motion, light])
    inverse = np.linalg.pinv(design.T @ design)
    solution = inverse @ design.T @ changes.ravel()
    residual = changes.ravel() - design @ solution
    variance = max(float(np.mean(residual**2)), 1e-12)
    coefficients = solution[:_TERMS]
    chi2 = coefficients @ np.linalg.pinv(inverse[:_TERMS, :_TERMS]) @ coefficients / variance
    largest = np.abs(shape @ coefficients).max()
    return bool(chi2 > THRESHOLDS.disagreement_chi2 and largest > THRESHOLDS.disagreement_px)


def _smooth_terms(n: int) -> Floats:
    """Compute the terms (n, _TERMS) of a smooth motion at n places, in order along the beam."""
    terms = np.polynomial.chebyshev.chebvander(np.linspace(-1, 1, n), _TERMS - 1)
    return np.asarray(terms, np.float64)
