"""Centreline of a beam in one photograph, from marks of its clamp and tip."""

import math
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from solver.centreline.smooth import FINE_DEGREE, running_median
from solver.core.correlation import correlation_length, field_correlation
from solver.instrument.arrays import Floats, Mask
from solver.instrument.errors import InputError
from solver.instrument.images import CHANNELS, read_colour, read_grey
from solver.instrument.medians import SIGMA_OVER_MAD
from solver.trace.edge_pairs import EdgePairs, edge_pairs
from solver.trace.equal_noise import Image, equal_noise
from solver.trace.path_search import NEAR_MARK, BeamPath, beam_paths
from solver.trace.sections import TAPER, Chord, Sections, course, section_places

# Channels of a photograph that may be traced: all of its colours, or one.
ALL_CHANNELS: Final = "all"
TRACE_CHANNELS: Final = (ALL_CHANNELS, *CHANNELS)
# Shortest beam [px]: a pixel for each of the fewest sections.
LEAST_LENGTH: Final = 80
# Fewest points. Chosen: a fit of a bent beam has about ten parameters.
LEAST_POINTS: Final = 40
# Smallest support and contrast [gray] of a path that is a beam. Measured: paths along texture or
# along a single edge reach a support of 0.2, those of drawn beams and cables begin at 0.7.
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
# Least certainty of a wider beam over that of the most certain one. Chosen: edges of 0.6 times the
# contrast have it, at 0.2 the edges of two beams count as one.
MIN_CERTAINTY: Final = 0.36
# Tangent of the angle by which a beam may turn between its last section and the mark. Chosen.
END_TURN: Final = 0.25
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


def photograph(path: Path, channel: str = ALL_CHANNELS) -> Image:
    """Read a photograph: all channels (height, width, 3), or one (height, width), as gray values.

    `channel` is one of TRACE_CHANNELS; a gray image has one channel. Pixels are used as they are
    stored: an orientation tag (EXIF) is ignored, as everywhere, and marks refer to the stored
    pixels. Raises InputError if the file is not an image.
    """
    image = read_colour(path) if channel == ALL_CHANNELS else read_grey(path, channel)
    return image.astype(np.float32)


def traced_beam(image: npt.NDArray[Any], clamp_px: Floats, tip_px: Floats) -> TracedBeam:
    """Trace the beam from its clamp to its tip in an image (height, width) or (height, width, 3).

    `clamp_px` and `tip_px` (2,) [px] need to be known to a few pixels only. The beam may be 1 to
    60 px wide. Each of its edges may have any contrast, in brightness or in colour, which may
    change along the beam. The errors of neighbouring points are correlated by grain and
    compression: the sigmas are larger than the scatter by the root of the correlation length, so
    that a fit to independent points has the right covariance. What is the same all along the beam,
    as light from one side, only shifts it: `shift_sigma`. Places at which an edge is hidden or
    disturbed are left out. Raises InputError where no beam is found.
    """
    clamp, tip = np.asarray(clamp_px, np.float64), np.asarray(tip_px, np.float64)
    _check_marks(image.shape, clamp, tip)
    channels = equal_noise(image)
    paths = beam_paths(channels, clamp, tip)
    strong = [
        path for path in paths if path.support >= MIN_SUPPORT and path.contrast >= MIN_CONTRAST
    ]
    if not strong:
        best = max(paths, key=lambda path: path.support)
        raise InputError(
            f"no beam is found from clamp_px {_shown(clamp)} to tip_px {_shown(tip)}: the best "
            f"path has two edges of {max(best.contrast, 0):.1f} gray on {100 * best.support:.0f} % "
            f"of its length, needed are {MIN_CONTRAST:.1f} gray on {100 * MIN_SUPPORT:.0f} %"
        )
    marks, length = np.array([clamp, tip]), math.dist(clamp, tip)
    chord = Chord(clamp, (tip - clamp) / length)
    likeliest = _likeliest([_first_fit(channels, path, chord, length) for path in strong], marks)
    fit = None if likeliest is None else _final_fit(channels, likeliest, chord)
    if fit is None or fit.off_marks(marks).max() > 1:
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

    def off_marks(self, marks: Floats) -> Floats:
        """Compute how far the line, extended straight, is off the marks (2, 2), over the allowed.

        The results (2,) are infinite with fewer than LEAST_POINTS sections.
        """
        kept = np.flatnonzero(self.kept)
        if len(kept) < LEAST_POINTS:
            return np.full(2, np.inf)
        ends = kept[[0, -1]]
        normals, tangents = self.sections.normals[ends], self.sections.tangents[ends]
        gap = marks - self.sections.points[ends] - self.pairs.centre[ends, None] * normals
        allowed = NEAR_MARK + END_TURN * np.abs(np.sum(gap * tangents, axis=1))
        return np.asarray(np.abs(np.sum(gap * normals, axis=1)) / allowed)

    def moved(self, chord: Chord) -> tuple[Sections, Floats]:
        """Move the sections to the middle of the edges; return them with the course of the width.

        Places of sections that are not kept are between, or beyond, those of others.
        """
        at, kept = self.sections.x, self.kept
        centres = self.sections.points + self.pairs.centre[:, None] * self.sections.normals
        moved = chord.sections(*chord.places(centres[kept]), at)
        return moved, course(at[kept], self.pairs.width[kept], at, TAPER)

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


def _likeliest(fits: list[_Fit], marks: Floats) -> _Fit | None:
    """Choose the widest beam about the most certain line: grain and highlights are within it.

    A line is certain by the information of its points, and by how near it is to the marks. Return
    None if none passes the marks.
    """
    fits = [fit for fit in fits if fit.off_marks(marks).max() <= 1]
    if not fits:
        return None
    beams = [fit.traced() for fit in fits]
    certainty = np.array(
        [
            np.sum(beam.sigmas**-2.0) * np.exp(-np.sum(fit.off_marks(marks) ** 2))
            for beam, fit in zip(beams, fits, strict=True)
        ]
    )
    widths = np.array([np.median(beam.widths) for beam in beams])
    line = cKDTree(beams[int(certainty.argmax())].points)
    apart = np.array([np.median(line.query(beam.points)[0]) for beam in beams])
    about = (certainty >= MIN_CERTAINTY * certainty.max()) & (apart < widths / 2)
    about[certainty.argmax()] = True
    return fits[int(np.argmax(np.where(about, widths, 0.0)))]


def _first_fit(image: Image, path: BeamPath, chord: Chord, length: float) -> _Fit:
    """Fit both edges along a path, which moves to their middle."""
    at = section_places(length, path.width)
    sections = chord.sections(*chord.places(path.points), at)
    widths = np.full(len(at), path.width)
    for width_sigma, relative_blur, least_blur in FIRST_FITS:
        blur = max(relative_blur * path.width, least_blur)
        pairs = _edges(image, sections, widths, width_sigma, blur)
        fit = _Fit(sections, pairs, _kept(pairs, sections))
        if np.count_nonzero(fit.kept) < LEAST_POINTS:
            break
        sections, widths = fit.moved(chord)
    return fit


def _final_fit(image: Image, first: _Fit, chord: Chord) -> _Fit:
    """Fit both edges with the blur that leaves the least residuals."""
    sections, widths = first.moved(chord)
    fits = [_edges(image, sections, widths, WIDTH_SIGMA, blur) for blur in BLURS]
    pairs = min(fits, key=lambda fit: float(np.median(fit.misfit)))
    return _Fit(sections, pairs, _kept(pairs, sections))


def _edges(
    image: Image, sections: Sections, widths: Floats, width_sigma: float, blur: float
) -> EdgePairs:
    """Fit the edges in all sections, with a `width_sigma` relative to the width."""
    width = float(np.median(widths))
    profiles, across = sections.profiles(image, width)
    return edge_pairs(profiles, across, -widths / 2, widths / 2, width_sigma * width, blur)


def _kept(pairs: EdgePairs, sections: Sections) -> Mask:
    """Return a mask (n,) of the sections with two undisturbed edges."""
    contrast = pairs.contrast.min(axis=1)
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
