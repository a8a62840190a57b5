"""Centreline of a beam in one photograph, from marks of its clamp and tip."""

import math
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from solver.centreline.smooth import FINE_DEGREE, running_median
from solver.core.correlation import correlation_length, field_correlation
from solver.instrument.arrays import Floats, Mask
from solver.instrument.errors import InputError
from solver.instrument.images import read_grey
from solver.instrument.medians import SIGMA_OVER_MAD
from solver.trace.edge_pairs import EdgePairs, edge_pairs
from solver.trace.path_search import NEAR_MARK, BeamPath, beam_paths
from solver.trace.sections import TAPER, Chord, Sections, course, section_places

# Shortest beam [px]: a pixel for each of the fewest sections.
LEAST_LENGTH: Final = 80
# Fewest points. Chosen: a fit of a bent beam has about ten parameters.
LEAST_POINTS: Final = 40
# Smallest support and contrast [gray] of a path that is a beam. Measured: paths along texture or
# along a single edge reach a support of 0.27, those of 150 drawn beams begin at 0.52.
MIN_SUPPORT, MIN_CONTRAST = 0.4, 2.0
# The edges are fitted three times: with the sigma of the width's prior, over the width, and with
# blurs over the width, at least that many pixels. The first are wide: the path is off by as much.
FIRST_FITS: Final = ((0.1, 1 / 8, 1.5), (0.2, 1 / 24, 1.2))
WIDTH_SIGMA: Final = 0.3
# Blurs [px] that are tried at last. Chosen: an error of 20 % moves both edges alike.
BLURS: Final = (0.5, 0.7, 1.0, 1.4, 2.0, 2.8)
# A section is rejected below this fraction of the median contrast, and beyond this many robust
# scatters of its width or centre, which are at least LEAST_SIGMA. Chosen.
MIN_RELATIVE_CONTRAST, REJECTED = 0.2, 5.0
# Least sigma [px]. Measured on drawn beams without grain or texture.
LEAST_SIGMA: Final = 0.02
# Sections over which the scatter is computed. Chosen: a third of the fewest.
_LOCAL: Final = np.int64(31)
# A section is kept if most of this many about it are. Chosen.
_NEIGHBOURS: Final = np.int64(5)


class TracedBeam(NamedTuple):
    """Centreline of a beam in a photograph: n points from the clamp to the tip.

    `points` (n, 2) [px] are in the middle of the two edges; `normals` (n, 2) are unit vectors,
    `sigmas` (n,) [px] standard errors along them, `widths` (n,) [px] those of the beam.
    `shift_sigma` [px] is the standard error of a shift of all points across the beam together.
    """

    points: Floats
    normals: Floats
    sigmas: Floats
    widths: Floats
    shift_sigma: float = 0.0


def photograph(path: Path, channel: str = "gray") -> npt.NDArray[np.float32]:
    """Read a channel of a photograph as gray values (height, width).

    `channel` is one of `instrument.images.CHANNELS`. Pixels are used as they are stored: an
    orientation tag (EXIF) is ignored, as everywhere, and marks refer to the stored pixels. Raises
    InputError if the file is not an image.
    """
    return read_grey(path, channel).astype(np.float32)


def traced_beam(image: npt.NDArray[np.floating], clamp_px: Floats, tip_px: Floats) -> TracedBeam:
    """Trace the beam from its clamp to its tip in an image (height, width) of one channel.

    `clamp_px` and `tip_px` (2,) [px] need to be known to a few pixels only. The beam may be 1 to
    60 px wide, brighter or darker than its background. The errors of neighbouring points are
    correlated by grain and compression: the sigmas are larger than the scatter by the root of the
    correlation length, so that a fit to independent points has the right covariance. What is the
    same all along the beam, as light from one side, only shifts it: `shift_sigma`. Places at
    which an edge is hidden or disturbed are left out. Raises InputError where no beam is found.
    """
    clamp, tip = np.asarray(clamp_px, np.float64), np.asarray(tip_px, np.float64)
    gray = np.ascontiguousarray(image, np.float32)
    _check_marks(gray.shape, clamp, tip)
    paths = beam_paths(gray, clamp, tip)
    if paths[0].support < MIN_SUPPORT or paths[0].contrast < MIN_CONTRAST:
        raise InputError(
            f"no beam is found from clamp_px {_shown(clamp)} to tip_px {_shown(tip)}: the best "
            f"path has two edges of {max(paths[0].contrast, 0):.1f} gray on "
            f"{100 * max(paths[0].support, 0):.0f} % of its length, needed are "
            f"{MIN_CONTRAST:.1f} gray on {100 * MIN_SUPPORT:.0f} %"
        )
    fits = (_fitted(gray, path, clamp, tip) for path in paths)
    fit = next((fit for fit in fits if fit.passes(clamp, tip)), None)
    if fit is None:
        raise InputError(
            f"no beam passes within {NEAR_MARK:.0f} px of both clamp_px {_shown(clamp)} and tip_px "
            f"{_shown(tip)} with two undisturbed edges in at least {LEAST_POINTS} sections"
        )
    return fit.traced()


class _Fit(NamedTuple):
    """Edges of a beam in sections, of which those that are `kept` (n,) are undisturbed."""

    sections: Sections
    pairs: EdgePairs
    kept: Mask

    def passes(self, clamp: Floats, tip: Floats) -> bool:
        """Return whether this is a beam from clamp to tip: enough sections, between the marks."""
        off = [
            (mark - self.sections.points[end]) @ self.sections.normals[end]
            for end, mark in ((0, clamp), (-1, tip))
        ]
        return bool(np.count_nonzero(self.kept) >= LEAST_POINTS and max(np.abs(off)) < NEAR_MARK)

    def traced(self) -> TracedBeam:
        """Compute points and sigmas of the sections that are kept."""
        kept, sections, pairs = self.kept, self.sections, self.pairs
        x, centre, width = sections.x[kept], pairs.centre[kept], pairs.width[kept]
        off = centre - course(x, centre, x, FINE_DEGREE)
        # The edges err independently: half the error of their distance is as large as that of
        # their middle. It has the slow part as well, which the course of the centre follows.
        half = (width - course(x, width, x, TAPER)) / 2
        residual = pairs.residual[kept]
        across, together = (field_correlation(residual, axis, tapered=True) for axis in (1, 0))
        along = field_correlation(residual - residual.mean(axis=0), 0, tapered=True)
        typical = [SIGMA_OVER_MAD * running_median(np.abs(error), _LOCAL) for error in (off, half)]
        formal = pairs.centre_sigma[kept] * np.sqrt(across)
        inflation = max(along, correlation_length(off), correlation_length(half))
        scatter = np.hypot(np.max([*typical, formal], axis=0), LEAST_SIGMA)
        return TracedBeam(
            sections.points[kept] + centre[:, None] * sections.normals[kept],
            sections.normals[kept],
            scatter * np.sqrt(inflation),
            width,
            float(np.median(scatter)) * math.sqrt(max(together, inflation) / len(x)),
        )


def _fitted(gray: npt.NDArray[np.float32], path: BeamPath, clamp: Floats, tip: Floats) -> _Fit:
    """Fit both edges along a path, which moves to their middle."""
    length = float(np.linalg.norm(tip - clamp))
    chord = Chord(clamp, (tip - clamp) / length)
    at = section_places(length, path.width)
    sections = chord.sections(*chord.places(path.points), at)
    widths = np.full(len(at), path.width)
    for width_sigma, relative_blur, least_blur in FIRST_FITS:
        blurs = (max(relative_blur * path.width, least_blur),)
        pairs = _edges(gray, sections, widths, width_sigma, blurs)
        kept = _kept(pairs, sections, path.sign)
        if np.count_nonzero(kept) < LEAST_POINTS:
            return _Fit(sections, pairs, kept)
        centres = sections.points + pairs.centre[:, None] * sections.normals
        sections = chord.sections(*chord.places(centres[kept]), at)
        widths = course(at[kept], pairs.width[kept], at, TAPER)
    pairs = _edges(gray, sections, widths, WIDTH_SIGMA, BLURS)
    return _Fit(sections, pairs, _kept(pairs, sections, path.sign))


def _edges(
    gray: npt.NDArray[np.float32],
    sections: Sections,
    widths: Floats,
    width_sigma: float,
    blurs: tuple[float, ...],
) -> EdgePairs:
    """Fit the edges in all sections with each of the blurs; return the fit that is best."""
    width = float(np.median(widths))
    profiles, across = sections.profiles(gray, width)
    fits = (
        edge_pairs(profiles, across, -widths / 2, widths / 2, width_sigma * width, blur)
        for blur in blurs
    )
    return min(fits, key=lambda fit: float(np.median(fit.misfit)))


def _kept(pairs: EdgePairs, sections: Sections, sign: int) -> Mask:
    """Return a mask (n,) of the sections with two undisturbed edges."""
    contrast = (sign * pairs.contrast).min(axis=1)
    least = max(MIN_RELATIVE_CONTRAST * float(np.median(contrast)), MIN_CONTRAST)
    kept = np.asarray(contrast > least)
    for values, degree in ((pairs.width, TAPER), (pairs.centre, FINE_DEGREE)):
        if np.any(kept):
            off = np.abs(values - course(sections.x[kept], values[kept], sections.x, degree))
            kept &= off < REJECTED * max(SIGMA_OVER_MAD * float(np.median(off[kept])), LEAST_SIGMA)
    # One of a shadow's edges may be where the beam's would be, but rarely twice.
    return np.asarray(kept & (running_median(kept.astype(float), _NEIGHBOURS) > 0))


def _check_marks(shape: tuple[int, ...], clamp: Floats, tip: Floats) -> None:
    """Raise InputError for marks outside the image, or too near to each other."""
    for name, mark in (("clamp_px", clamp), ("tip_px", tip)):
        if not (0 <= mark[0] < shape[1] and 0 <= mark[1] < shape[0]):
            raise InputError(
                f"{name} is {_shown(mark)}, allowed is a place in the image of "
                f"{shape[1]} x {shape[0]} px"
            )
    length = float(np.linalg.norm(tip - clamp))
    if length < LEAST_LENGTH:
        raise InputError(
            f"clamp_px {_shown(clamp)} and tip_px {_shown(tip)} are {length:.0f} px apart, "
            f"allowed are at least {LEAST_LENGTH} px"
        )


def _shown(mark: Floats) -> str:
    return f"[{mark[0]:.1f}, {mark[1]:.1f}]"
