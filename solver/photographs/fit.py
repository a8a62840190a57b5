"""Fit photographs of one beam jointly: starts, outliers, photographs that fit no single load.

Each photograph is first fitted by itself. In the joint fit Tukey's biweight, at the scale of each
photograph's residuals, rejects points; the fit of the others is least squares. Residuals that are
larger than stated, or correlated along the beam, widen the covariance.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np

from solver.core.correlation import correlation_length
from solver.core.least_squares import CONVERGED, Minimum, NormalEquations, Rows, information_of
from solver.core.robust import MEDIAN, tukey
from solver.core.thresholds import THRESHOLDS
from solver.instrument.arrays import Floats, Mask
from solver.instrument.medians import TUKEY_CUT
from solver.photographs.joint import PhotosProblem
from solver.photographs.photo_set import PhotoSet
from solver.photographs.prior import Prior, nominal_rigidity, prior_of
from solver.photographs.problem import PhotoProblem
from solver.photographs.starts import side_of, starts_of
from solver.tracing.beam_fit import TracedBeam

# Errors of the points, over the beam's length, of the first fits. Chosen: they are too coarse to
# show the bow and the lens, which the angles of the views would follow.
_COARSE: Final = (5e-3, 5e-4)
# Weights follow the residuals this often. Chosen: they change little after the third time.
_REWEIGHTINGS: Final = 4
# Least scale of residuals that are smaller than stated. Chosen: sigmas that contain a correlation
# are up to ten times the scatter.
_LEAST_SCALE: Final = 0.1
# Root mean square [sigma] of the residuals of a photograph that fits. Chosen: a wooden beam that is
# not quite uniform is fitted to five times the scatter of its points, and its sigmas are widened.
MAX_MISFIT: Final = 5.0


class Shown(NamedTuple):
    """Beam in a photograph: its points [px], and size (2,) of the image: width, height [px]."""

    beam: TracedBeam
    size: tuple[int, int]


@dataclass(frozen=True)
class PhotoFit:
    """How one photograph fits: points that were `kept` (n,), their misfit, rms in sigmas.

    `inflation` is the factor of the variances of its points.
    """

    kept: Mask
    misfit: float
    inflation: float

    @property
    def fits(self) -> bool:
        """Whether a beam with a single load has the shape of the points."""
        return self.misfit <= MAX_MISFIT and (~self.kept).mean() <= THRESHOLDS.max_rejected


@dataclass(frozen=True)
class PhotosFit:
    """Joint fit of photographs: `problem`, minimum `at`, `covariance` (p, p), and each one's fit.

    `prior` (p,) are the sigmas of the prior, infinite where there is none.
    """

    problem: PhotosProblem
    at: NormalEquations
    covariance: Floats
    converged: bool
    fits: tuple[PhotoFit, ...]
    prior: Floats


def problems_of(photos: PhotoSet, shown: Sequence[Shown]) -> list[PhotoProblem]:
    """Convert photographs to their residuals' data, relative to the middle of the image."""
    length = photos.length.value
    problems = []
    for photo, (beam, size) in zip(photos.photographs, shown, strict=True):
        middle = (np.array(size) - 1) / 2
        problems.append(
            PhotoProblem(
                points=beam.points - middle,
                sigmas=beam.normals * beam.sigmas[:, None],
                clamp=photo.clamp - middle,
                tip=photo.tip - middle,
                marks=np.column_stack([photo.marks[:, :2] - middle, photo.marks[:, 2:] / length]),
                # The line may be shifted against all marks.
                mark_sigma=math.hypot(photos.mark_sigma, beam.shift_sigma),
                load=photo.load,
                side=side_of(beam.points, photo.clamp, photo.tip, photo.load, photos.down.value),
                widths=len(photos.shape.widths),
                down=photos.down.value,
                length=length,
                nominal_force=nominal_rigidity(photos) / length**2,
            )
        )
    return problems


def fit_photos(photos: PhotoSet, shown: Sequence[Shown]) -> PhotosFit | None:
    """Fit photographs of one beam; None if no beam has the shape of one of them."""
    problems = problems_of(photos, shown)
    prior = prior_of(photos, problems, max(math.hypot(*one.size) for one in shown))
    problem = _joint(problems, prior)
    p = _starts(_coarse(problem, _COARSE[0]))
    fitted = None if p is None else _from_coarse(problem, p)
    if fitted is None:
        return None
    weights = _reweighted(problem, fitted.at).weights
    for _ in range(_REWEIGHTINGS):
        if all((one > 0).all() for one in weights):  # no outliers
            break
        fitted = replace(problem, weights=weights).minimised(fitted.at.p) or fitted
        weights = _reweighted(problem, fitted.at).weights
    fits = tuple(map(_photo_fit, problems, fitted.at.rows, weights))
    final = replace(problem, weights=tuple(one.kept / one.inflation for one in fits))
    last = final.minimised(fitted.at.p) or fitted
    errors = last.at.covariance()
    if errors is None:
        return None
    sigmas = np.where(prior.open, np.inf, np.sqrt(np.diag(prior.covariance)))
    return PhotosFit(final, last.at, errors, last.status == CONVERGED, fits, sigmas)


def _from_coarse(problem: PhotosProblem, p: Floats) -> Minimum | None:
    fitted = None
    for error in (*_COARSE, 0.0):
        fitted = _coarse(problem, error).minimised(p if fitted is None else fitted.at.p)
        if fitted is None:
            break
    return fitted


def _joint(problems: Sequence[PhotoProblem], prior: Prior) -> PhotosProblem:
    return PhotosProblem(
        photos=tuple(problems),
        mean=prior.mean,
        information=information_of(prior.covariance),
        free=np.flatnonzero((np.diag(prior.covariance) > 0) | prior.open),
        weights=tuple(np.ones(len(problem.points)) for problem in problems),
    )


def _coarse(problem: PhotosProblem, error: float) -> PhotosProblem:
    """Return the problem with points of this least error, over the length of the beam."""
    weights = []
    for photo in problem.photos:
        least = error * math.hypot(*(photo.tip - photo.clamp))
        square = (photo.sigmas**2).sum(axis=1)
        weights.append(square / np.maximum(square, least**2))
    return replace(problem, weights=tuple(weights))


def _starts(problem: PhotosProblem) -> Floats | None:
    """Return all parameters (p,), each photograph's fitted by itself."""
    start = problem.mean.copy()
    for i in range(len(problem.photos)):
        columns = problem.columns(i)
        own = _start(problem, i, problem.mean[columns])
        if own is None:
            return None
        start[columns[problem.shared :]] = own
    start[problem.parameters["rigidity"]] = _rigidity(problem, start)
    return start


def _start(problem: PhotosProblem, photo: int, mean: Floats) -> Floats | None:
    """Fit one photograph with the shared parameters of the prior; return its own (10,)."""
    own, shared = problem.photos[photo], problem.shared
    place = own.load.place.value / own.length if own.load and own.load.place else None
    columns = np.array(problem.columns(photo))
    # The scale of the forces is unknown until a load is.
    alone = replace(own, load=replace(own.load, force=None) if own.load else None)
    free = [i for i in range(shared, len(mean)) if columns[i] in problem.free]
    single = PhotosProblem(
        photos=(alone,),
        mean=mean,
        information=problem.information[np.ix_(columns, columns)],
        free=np.array(free),
        weights=(problem.weights[photo],),
    )
    best: Minimum | None = None
    for start in starts_of(own.points, own.clamp, own.tip, own.side, place, own.load is not None):
        p = mean.copy()
        p[shared:] = start
        fitted = single.minimised(p)
        if fitted and (best is None or fitted.at.objective < best.at.objective):
            best = fitted
    return None if best is None else best.at.p[shared:]


def _rigidity(problem: PhotosProblem, start: Floats) -> float:
    """Return the log of EI over its nominal value that the known forces give; the median."""
    ratios = []
    for i, photo in enumerate(problem.photos):
        p = start[problem.columns(i)]
        bent = photo.bent(p) if photo.load and photo.load.force else None
        if bent and photo.load and photo.load.force:
            ratios.append(math.log(photo.load.force.value / photo.force(p, bent)[0]))
    free = problem.parameters["rigidity"] in problem.free
    return float(np.median(ratios)) if ratios and free else 0.0


def _scale(points: Floats) -> float:
    return max(float(np.median(np.abs(points))) / MEDIAN, _LEAST_SCALE)


def _reweighted(problem: PhotosProblem, at: NormalEquations) -> PhotosProblem:
    """Return the problem with Tukey's weights at the scale of each photograph's residuals."""
    return replace(
        problem,
        weights=tuple(
            _weights(rows.residual[: len(photo.points)])
            for photo, rows in zip(problem.photos, at.rows, strict=True)
        ),
    )


def _weights(points: Floats) -> Floats:
    weights = np.empty(len(points))
    scaled = np.ascontiguousarray(points / _scale(points))
    tukey(scaled, TUKEY_CUT, weights)
    return weights


def _photo_fit(photo: PhotoProblem, rows: Rows, weights: Floats) -> PhotoFit:
    kept = weights > 0
    points = rows.residual[: len(photo.points)][kept]
    square = float((points**2).mean())
    inflation = max(square * correlation_length(points), 1.0)
    return PhotoFit(kept, math.sqrt(square), inflation)
