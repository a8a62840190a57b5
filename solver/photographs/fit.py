"""Fit photographs of one beam jointly: starts, outliers, photographs that fit no single load.

Each photograph is first fitted by itself. In the joint fit Tukey's biweight, at the scale of each
photograph's residuals, rejects points; the fit of the others is least squares. The sigmas of points
contain the correlation of neighbours, so that their scatter alone says nothing about the fit: the
misfit is that of means over the correlation length of the residuals.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np
from scipy.spatial.distance import pdist
from scipy.stats import theilslopes

from solver.core.correlation import correlation_length
from solver.core.least_squares import CONVERGED, Minimum, NormalEquations, Rows, information_of
from solver.core.robust import tukey
from solver.core.thresholds import THRESHOLDS
from solver.instrument.arrays import Floats, Mask
from solver.instrument.medians import SIGMA_OVER_MAD, TUKEY_CUT
from solver.photographs.joint import LEAST_LOAD, PhotosProblem
from solver.photographs.photo_set import Photograph, PhotoSet, Stated
from solver.photographs.prior import Prior, nominal_rigidity, prior_of
from solver.photographs.problem import PhotoProblem
from solver.photographs.starts import places_tried, side_of, starts_of
from solver.tracing.beam_fit import TracedBeam

# Errors of the points, over the beam's length, of the first fits. Chosen: they are too coarse to
# show the bow and the lens, which the angles of the views would follow.
_COARSE: Final = (5e-3, 5e-4)
# Weights follow the residuals this often. Chosen: they change little after the third time.
_REWEIGHTINGS: Final = 4
# Least scale of residuals that are smaller than stated. Chosen: sigmas that contain a correlation
# are up to ten times the scatter.
_LEAST_SCALE: Final = 0.1
# Misfit of a photograph that fits, over the scale of all. Chosen: a wooden beam is not quite
# uniform; its sigmas are widened by the misfit.
MAX_MISFIT: Final = 5.0
# Shift of the beam's image at its clamp, over its width; it falls to a third in every width along
# the beam. Chosen: a clamp hides or shades a part of an edge there.
_CLAMP_BIAS: Final = 0.1
# Least misfit that is expected. Chosen: with less, a photograph before another background would
# not fit.
_LEAST_EXPECTED: Final = 0.5
# Sigma of the width at the tip over that at the clamp, and of a width [px]. Chosen: a round stick
# is as uniform, and blur as well as light from one side widen a beam by less.
_WIDTH_SIGMA, _WIDTH_SIGMA_PX = 0.05, 0.5
# Least share of a beam's length that is visible. Chosen: less shows no bend.
_LEAST_VISIBLE: Final = 0.1


class Shown(NamedTuple):
    """Beam in a photograph: its points [px], and size (2,) of the image: width, height [px]."""

    beam: TracedBeam
    size: tuple[int, int]


@dataclass(frozen=True)
class PhotoFit:
    """How one photograph fits: points that were `kept` (n,), and their misfit.

    The misfit is the rms, in sigmas, of means of residuals over their correlation length; of these
    there are `independent`. `scale` is what is expected of it, the median of all photographs, but
    at most 1: the stated sigmas contain slow errors, which the fit follows.
    """

    kept: Mask
    misfit: float
    independent: float
    scale: float = 1.0

    @property
    def inflation(self) -> float:
        """Factor of the variances of the points."""
        return max(self.misfit, 1.0) ** 2

    @property
    def fits(self) -> bool:
        """Whether a beam with a single load has the shape of the points."""
        return (
            self.misfit <= MAX_MISFIT * self.scale
            and (~self.kept).mean() <= THRESHOLDS.max_rejected
        )


@dataclass(frozen=True)
class PhotosFit:
    """Joint fit of photographs: `problem`, minimum `at`, `covariance` (p, p), and each one's fit.

    `prior` (p,) are the sigmas of the prior, infinite where there is none.
    """

    problem: PhotosProblem
    at: NormalEquations
    covariance: Floats
    fits: tuple[PhotoFit, ...]
    prior: Floats


class Unfitted(NamedTuple):
    """Index of the photograph that prevents a joint fit."""

    photo: int


def problems_of(photos: PhotoSet, shown: Sequence[Shown]) -> list[PhotoProblem]:
    """Convert photographs to their residuals' data, relative to the middle of the image."""
    length = photos.length.value
    # A tick's error is the same in all photographs, which is that of their mean.
    same = math.sqrt(max(sum(len(photo.ticks) > 0 for photo in photos.photographs), 1))
    problems = []
    for photo, (beam, size) in zip(photos.photographs, shown, strict=True):
        centre, visible = principal_point(photo, size), _visible(photo, length)
        problems.append(
            PhotoProblem(
                points=beam.points - centre,
                sigmas=beam.normals * np.hypot(beam.sigmas, _clamp_bias(beam, photo))[:, None],
                clamp=photo.clamp - centre,
                tip=photo.tip - centre,
                marks=np.column_stack([photo.marks[:, :2] - centre, photo.marks[:, 2:] / length]),
                ticks=np.column_stack([photo.ticks[:, :2] - centre, photo.ticks[:, 2:] / length])
                * [1, 1, 1, same],
                tip_seen=not photo.tip_hidden,
                visible=visible,
                width_ratio=_width_ratio(beam, photo, visible),
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


def principal_point(photo: Photograph, size: tuple[int, int]) -> Floats:
    """Return the principal point (2,) [px] of an image with this width and height."""
    stated = photo.principal_point
    return (np.array(size) - 1) / 2 if stated is None else stated


def _clamp_bias(beam: TracedBeam, photo: Photograph) -> Floats:
    """Return sigmas (n,) [px] of the shift of points by shadows and edges of the clamp."""
    widths = np.linalg.norm(beam.points - photo.clamp, axis=1) / beam.widths
    return np.asarray(_CLAMP_BIAS * beam.widths * np.exp(-widths))


def _visible(photo: Photograph, length: float) -> float:
    """Return the share of the length [m] up to `tip`, by ticks or marks if the tip is hidden."""
    if not photo.tip_hidden:
        return 1.0
    if len(photo.ticks):
        *pixel, arc, _ = photo.ticks[photo.ticks[:, 2].argmax()]
        apart_px, apart = math.dist(pixel, photo.clamp), float(arc)
    else:
        apart_px, apart = (float(pdist(photo.marks[:, of]).max()) for of in (slice(2), slice(2, 4)))
    chord = math.dist(photo.tip, photo.clamp)
    return float(np.clip(chord / max(apart_px, 1.0) * apart / length, _LEAST_VISIBLE, 1.0))


def _width_ratio(beam: TracedBeam, photo: Photograph, visible: float) -> Stated:
    """Return the log of the beam's width at the tip over that at the clamp, by Theil and Sen.

    It is extrapolated from the `visible` share of the length.
    """
    chord = photo.tip - photo.clamp
    along = (beam.points - photo.clamp) @ chord / (chord @ chord) * visible
    ratio = float(theilslopes(np.log(beam.widths), along).slope)
    sigma = math.hypot(_WIDTH_SIGMA, _WIDTH_SIGMA_PX / float(np.median(beam.widths)))
    return Stated(ratio, sigma / visible)


def fit_photos(photos: PhotoSet, shown: Sequence[Shown]) -> PhotosFit | Unfitted:
    """Fit photographs of one beam, or name the photograph that prevents it."""
    problems = problems_of(photos, shown)
    prior = prior_of(photos, problems, max(math.hypot(*one.size) for one in shown))
    problem = _joint(problems, prior)
    coarse, p = _coarse(problem, _COARSE[0]), problem.mean.copy()
    # Photographs at rest come first: loads are compared with their bow.
    for i in sorted(range(len(problems)), key=lambda i: problems[i].load is not None):
        start = _start(coarse, i, p)
        if start is None:
            return Unfitted(i)
        p[problem.columns(i)] = start
    p = _with_known_forces(problem, p)
    for error in _COARSE:
        near = _coarse(problem, error).minimised(p)
        p = p if near is None else near.at.p
    fitted = problem.minimised(p)
    if fitted is None:
        return _unfitted(problem, p)
    weights = _reweighted(problem, fitted.at).weights
    for _ in range(_REWEIGHTINGS):
        if all((one > 0).all() for one in weights):  # no outliers
            break
        fitted = replace(problem, weights=weights).minimised(fitted.at.p) or fitted
        weights = _reweighted(problem, fitted.at).weights
    fits = tuple(map(_photo_fit, problems, fitted.at.rows, weights))
    scale = float(np.clip(np.median([one.misfit for one in fits]), _LEAST_EXPECTED, 1))
    fits = tuple(replace(one, scale=scale) for one in fits)
    final = replace(problem, weights=tuple(one.kept / one.inflation for one in fits))
    last = final.minimised(fitted.at.p)
    # A bound stops an estimate, but not its error.
    of_all = final.equations(last.at.p) if last and last.status == CONVERGED else None
    errors = of_all.covariance() if of_all else None
    if last is None or errors is None:
        return _unfitted(problem, fitted.at.p)
    sigmas = np.where(prior.open, np.inf, np.sqrt(np.diag(prior.covariance)))
    return PhotosFit(final, last.at, errors, fits, sigmas)


def load_gain(fit: PhotosFit, photo: int) -> float:
    """Return how much larger the least sum of squares is without the load of a photograph.

    Bow, sag, clamp, lens and views then explain its bend. Without a load it has the distribution of
    chi2 with two degrees of freedom.
    """
    problem, own = fit.problem, fit.problem.photos[photo]
    columns, start = problem.columns(photo), fit.at.p.copy()
    of_load = [columns[i] for i in own.parameters.indices("q", "s_c", "friction_ratio")]
    start[of_load] = problem.mean[of_load]
    photos = tuple(
        replace(one, load=None) if i == photo else one for i, one in enumerate(problem.photos)
    )
    without = replace(problem, photos=photos, free=np.setdiff1d(problem.free, of_load))
    least = without.minimised(start)
    if least is not None and least.status == CONVERGED:
        return float(least.at.objective - fit.at.objective)
    # What the linear model expects.
    load = of_load[0]
    return float(fit.at.p[load] ** 2 / fit.covariance[load, load])


def _unfitted(problem: PhotosProblem, p: Floats) -> Unfitted:
    """Return the photograph whose points are farthest from the beam with the parameters p (p,)."""
    squares = []
    for i, photo in enumerate(problem.photos):
        rows = photo.rows(p[problem.columns(i)])
        residual = np.array([np.inf]) if rows is None else rows.residual[: len(photo.points)]
        squares.append(float((residual**2).mean()))
    return Unfitted(squares.index(max(squares)))


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


def _start(problem: PhotosProblem, photo: int, p: Floats) -> Floats | None:
    """Fit one photograph by itself, from p (p,); return the shared parameters and its own.

    The shared ones are fixed, but for the bow of a photograph at rest.
    """
    own, shared = problem.photos[photo], problem.shared
    places = places_tried(own.load.place, own.length) if own.load else []
    columns = np.array(problem.columns(photo))
    mean = problem.mean[columns]
    # The scale of the forces is unknown until a load is.
    alone = replace(own, load=replace(own.load, force=None) if own.load else None)
    bow = own.parameters.indices("bow") if own.load is None else []
    free = [i for i in (*bow, *range(shared, len(mean))) if columns[i] in problem.free]
    single = PhotosProblem(
        photos=(alone,),
        mean=mean,
        information=problem.information[np.ix_(columns, columns)],
        free=np.array(free),
        weights=(problem.weights[photo],),
    )
    best: Minimum | None = None
    for start in starts_of(own.points, own.clamp, own.tip, own.side, places):
        fitted = single.minimised(np.append(p[:shared], start))
        if fitted and (best is None or fitted.at.objective < best.at.objective):
            best = fitted
    return None if best is None else best.at.p


def _with_known_forces(problem: PhotosProblem, start: Floats) -> Floats:
    """Return the start (p,) with EI from the known force that bends most, and loads from EI."""
    p, rigidity = start.copy(), problem.parameters["rigidity"]
    loads = {}
    for i, photo in enumerate(problem.photos):
        own = start[problem.columns(i)]
        bent = photo.bent(own) if photo.load and photo.load.force else None
        if bent and photo.load and photo.load.force:
            column = problem.columns(i)[photo.parameters["q"]]
            loads[column] = photo.load.force.value / photo.force(own, bent)[0] * start[column]
    if loads and rigidity in problem.free:
        most = max(loads, key=lambda column: start[column])
        p[rigidity] = math.log(loads[most] / start[most])
    for column, load in loads.items():
        p[column] = max(load / math.exp(p[rigidity]), LEAST_LOAD)
    return p


def _scale(points: Floats) -> float:
    return max(SIGMA_OVER_MAD * float(np.median(np.abs(points))), _LEAST_SCALE)


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
    correlated = correlation_length(points)
    misfit = math.sqrt(float((points**2).mean()) * correlated)
    return PhotoFit(kept, misfit, len(points) / correlated)
