"""Search for the section whose profile leaves the smoothest centres and the smallest residuals."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize

from solver.centreline.profile import MAX_OWN_SKEW, MAX_SKEW, Section
from solver.centreline.rest_columns import RestColumns, Shape
from solver.centreline.thresholds import THRESHOLDS
from solver.instrument.arrays import Floats

# Where a thin beam lies along one row of pixels, the images hardly determine its section: a prior
# does. The width over the rig's is 1 in a sharp image; sharpening and defocus change its logarithm
# by up to 0.35, so that this prior has long tails. Light from the front leaves no skew. Chosen, but
# for the roundness: that of 22 rigs of random/rigs.yaml.
WIDTH_SIGMA, ROUNDNESS, ROUNDNESS_SIGMA, SKEW_SIGMA = 0.02, 1.3, 0.9, 0.3
# Start values: diameter over the rig's, spread, roundness, skew, taper. A sharpened beam looks
# narrower than it is, a defocused one wider.
SHARP_STARTS = ((1.0, 0.05, ROUNDNESS, 0.0, 0.0),)
STARTS = ((1.0, 0.3, 1.0, 0.0, 0.0), (1.0, 0.8, 0.5, 0.0, 0.0))
PROCESSED_STARTS = tuple((scale, *rest) for scale in (0.7, 1.4) for _, *rest in STARTS)


class _Search(NamedTuple):
    """First steps of the parameters in a search, 0 for one that is held, and its most trials."""

    steps: tuple[float, ...]
    trials: int


class _Criterion(NamedTuple):
    """What all candidates of a search are judged by.

    Misfits are in units of `misfit_unit`. All are compared on the same pixels, `half` on either
    side of the beam: a narrow section on fewer pixels would leave fewer of them unexplained.
    """

    misfit_unit: float
    half: int


# Steps are chosen: a section changes the image by much more than the noise. Trials are more than a
# search needs. Measured: searches end after 100 to 240; stopped after 90, they left the errors of a
# wrong profile, which follow the pixel rows, and sigmas of x_c that were 2.5 times larger.
UNIFORM, TAPERED = _Search((0.1, 0.2, 0.4, 0.1, 0.0), 400), _Search((0.1, 0.2, 0.4, 0.1, 0.3), 500)
# Of a profile that is seen in part, a search that goes on describes what the model lacks, by shapes
# far from a beam's that are wrong at all other places between the pixels: it stays near its start.
# Measured: of 30 rigs, one was refused or wrong by three sigmas where searches had ended.
IN_PART = UNIFORM._replace(trials=90)
# A taper that is tried before it is searched for, and the fall of chi^2 that it must promise. The
# first is chosen: a fortieth of a pixel at the ends of a thin beam. The second is derived: noise
# alone gives more in one rig of a thousand.
TRIED_TAPER, MIN_GAIN = 0.1, 10.8
# Sections whose costs differ by less explain the images alike. Derived: three sigmas.
_EQUAL_COST = 9.0
# Range of the weight of the beam's own light in its contrast, from which grounds differ. Chosen:
# with the skew of SKEW_SIGMA, 0.1 moves a place by a hundredth of the radius.
_MIN_WEIGHTS = 0.1
# A profile of the beam's own light is the better one if it shows this many times the columns that
# those of the contrast show. Chosen: of a beam before stripes, the latter show half.
_MORE_SHOWN = 1.1
# What a section that describes nothing costs.
_NOTHING = 1e12


def find_sections(rest: RestColumns) -> list[Section]:
    """Find the beam's section, the best one first; none where no section shows the beam.

    Where the images show the profile in part, there may be two: searches from different starts end
    at sections that explain them alike, and that differ by what is not known.
    """
    found = [_best(rest, starts, 1.0) for starts in (STARTS, SHARP_STARTS)[: 1 + rest.in_part]]
    if len(found) > 1:
        criterion = _Criterion(1.0, max(_half(rest, p) for p in found))
        costs = [_cost(rest, p, criterion) for p in found]
        order = np.argsort(costs)
        found = [found[k] for k in order if costs[k] < min(costs) + _EQUAL_COST]
    misfit = _misfit(rest, found[0])
    if misfit > THRESHOLDS.processed_misfit:
        # The noise of processed images is no reference: misfits are scaled by that of the first.
        found = [_best(rest, (*STARTS, *PROCESSED_STARTS), misfit)]
    return [section for p in found if (section := _section(p, rest)) is not None]


def find_in_own_light(rest: RestColumns, shapes: Sequence[Shape]) -> list[Section]:
    """Find sections of the beam's own light, from the `shapes` of its contrast with the ground.

    A contrast has the same section in all columns only where the ground is everywhere alike. The
    best one is first; there are none where the grounds are alike, or where the sections of the
    contrast explain the images as well, in as many columns.
    """
    weights = [_own_weights(shape, rest.polarity) for shape in shapes]
    if not any(np.ptp(np.percentile(w, (10, 90))) > _MIN_WEIGHTS for w in weights if len(w)):
        return []
    own = replace(rest, own_light=True)
    criterion = _Criterion(1.0, max(rest.half_width(shape.section) for shape in shapes))
    search = IN_PART if rest.in_part else UNIFORM
    contrasts, found = [], []
    for shape, weight in zip(shapes, weights, strict=True):
        one, typical = shape.section, float(np.median(weight)) if len(weight) else 1.0
        p = np.array([one.radius / rest.radius, one.spread, one.roundness, one.skew, one.taper])
        contrasts.append(_judge(rest, p, criterion))
        # Of the contrast, the beam's own shading is a larger part than of its light.
        p[2:4] /= max(typical, 1.0)
        found.append(_search(own, p, search, criterion))
    judged = [_judge(own, p, criterion) for p in found]
    costs = np.array([one.cost for one in judged])
    at_most = costs.min() + _EQUAL_COST
    shown = max(one.shown for one in contrasts)
    if max(one.shown for one in judged) < _MORE_SHOWN * shown:
        at_most = min(at_most, min(one.cost for one in contrasts) - _EQUAL_COST)
    best = [found[k] for k in np.argsort(costs) if costs[k] < at_most]
    return [section for p in best if (section := _section(p, own)) is not None]


def _own_weights(shape: Shape, polarity: int) -> Floats:
    """Compute the weight (n,) of the beam's own light in its contrast, in columns that show it.

    Before another ground, columns need not look like the others.
    """
    amplitude, sigma, ground = (
        np.mean([getattr(f, name) for f in shape.fits], axis=0)
        for name in ("amplitude", "amplitude_sigma", "background")
    )
    shown = polarity * amplitude > THRESHOLDS.amplitude_sigmas * sigma
    return np.asarray(1 + 2 * shape.section.radius * ground[shown] / amplitude[shown])


def _section(p: Floats, rest: RestColumns) -> Section | None:
    """Return the section with these parameters (5,) and the rig's radius; None if absurd."""
    scale, spread, roundness, skew, taper = (float(v) for v in p)
    # The mirror image of a negative spread or roundness: a wall would end a search beside it.
    spread, roundness = abs(spread), abs(roundness)
    possible = 0.4 < scale < 2.5 and spread <= 4 and roundness <= 4
    max_skew = MAX_OWN_SKEW if rest.own_light else MAX_SKEW
    if not (possible and abs(skew) < max_skew and abs(taper) < 1.9):
        return None
    return Section(scale * rest.radius, spread, roundness, skew, taper)


class _Judged(NamedTuple):
    """Cost of parameters, and the number of columns that their section shows."""

    cost: float
    shown: int


def _cost(rest: RestColumns, p: Floats, criterion: _Criterion) -> float:
    """Compute the cost of parameters (5,)."""
    return _judge(rest, p, criterion).cost


def _judge(rest: RestColumns, p: Floats, criterion: _Criterion) -> _Judged:
    """Compute roughness and misfit of parameters (5,), and what their prior adds.

    A column that a section does not show costs as much as the mean of the others: a section is not
    better because it shows fewer of them.
    """
    section = _section(p, rest)
    if section is None:
        return _Judged(_NOTHING, 0)
    misfit_unit = criterion.misfit_unit
    fits = rest.fits(rest.table(section), criterion.half)
    centre, good = rest.off_path(fits), rest.like_the_beam(fits, section)
    shown = int(np.count_nonzero(good))
    if shown < THRESHOLDS.min_stations:
        return _Judged(_NOTHING, shown)
    residual = centre - rest.smooth(centre, good)
    sigma = np.median([f.sigma[good] for f in fits], axis=0) / np.sqrt(len(fits))
    # The Cauchy loss limits the influence of an object at a few columns, and keeps a gradient for
    # a start that is far off in all of them.
    roughness = np.log1p((residual[good] / sigma) ** 2 / misfit_unit / 25).sum() * 25
    misfit = sum(np.log1p(f.chi2[good] / f.dof[good] / misfit_unit / 9).sum() * 36 for f in fits)
    width = np.log1p((np.log(p[0]) / WIDTH_SIGMA) ** 2)
    prior = width + ((abs(p[2]) - ROUNDNESS) / ROUNDNESS_SIGMA) ** 2 + (p[3] / SKEW_SIGMA) ** 2
    return _Judged(float((roughness + misfit) * len(good) / shown + prior), shown)


def _best(rest: RestColumns, starts: Sequence[tuple[float, ...]], misfit_unit: float) -> Floats:
    """Find the parameters (5,) of minimum cost from the best of `starts`, first without a taper."""
    candidates = [np.array(start) for start in starts]
    criterion = _Criterion(misfit_unit, max(_half(rest, p) for p in candidates))
    search = IN_PART if rest.in_part else UNIFORM
    p = _search(rest, min(candidates, key=lambda p: _cost(rest, p, criterion)), search, criterion)
    if _half(rest, p) > criterion.half:
        criterion = _Criterion(misfit_unit, _half(rest, p))
        p = _search(rest, p, search, criterion)
    if _promises_taper(rest, p, criterion):
        # A search that begins anew leaves the valley of sections that are as wide and less round.
        for _ in range(2):
            p = _search(rest, p, TAPERED, criterion)
    return p


def _half(rest: RestColumns, p: Floats) -> int:
    """Return the pixels on either side that parameters (5,) need; 0 if they are absurd."""
    section = _section(p, rest)
    return 0 if section is None else rest.half_width(section)


def _search(rest: RestColumns, start: Floats, search: _Search, criterion: _Criterion) -> Floats:
    """Minimise the cost from `start` (5,), in the parameters that are not held."""
    free = np.array(search.steps) > 0
    axes = np.diag(search.steps)[free]

    def full(q: Floats) -> Floats:
        p = start.copy()
        p[free] = q
        return p

    result = minimize(
        lambda q: _cost(rest, full(q), criterion),
        start[free],
        method="Nelder-Mead",
        options={
            "initial_simplex": np.vstack([start, start + axes])[:, free],
            "maxfev": search.trials,
            "xatol": 5e-3,
            "fatol": 1.0,
        },
    )
    return full(np.asarray(result.x))


def _promises_taper(rest: RestColumns, p: Floats, criterion: _Criterion) -> bool:
    """Return whether the parabola through three tapers falls by MIN_GAIN, or has no minimum."""
    thinner, same, thicker = (
        _cost(rest, p + np.array([0, 0, 0, 0, taper]), criterion)
        for taper in (-TRIED_TAPER, 0.0, TRIED_TAPER)
    )
    slope, curvature = (thicker - thinner) / 2, thicker - 2 * same + thinner
    return curvature <= 0 < abs(slope) or slope**2 > 2 * curvature * MIN_GAIN


def _misfit(rest: RestColumns, p: Floats) -> float:
    """Compute the median chi^2 per degree of freedom of a section's fits; at least 1."""
    section = _section(p, rest)
    fits = [] if section is None else rest.fits(rest.table(section), rest.half_width(section))
    misfits = [f.chi2 / np.maximum(f.dof, 1) for f in fits if np.isfinite(f.sigma).any()]
    return max(1.0, float(np.median(misfits))) if misfits else 1.0
