"""Fit of both edges of a beam in sections along a path, and the centreline that follows from it."""

import math
from enum import StrEnum
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from solver.centreline.smooth import FINE_DEGREE, running_median
from solver.core.correlation import correlation_length, field_correlation
from solver.instrument.arrays import Floats, Mask
from solver.instrument.medians import SIGMA_OVER_MAD
from solver.tracing.edge_pairs import EdgePairs, edge_pairs
from solver.tracing.equal_noise import Image
from solver.tracing.path_search import BeamPath
from solver.tracing.sections import TAPER, Chord, Sections, course, section_places

# Fewest points. Chosen: a fit of a bent beam has about ten parameters.
LEAST_POINTS: Final = 40
# The edges are fitted three times: with the sigma of the width's prior, over the width, and with
# blurs over the width, at least that many pixels. The first are wide: the path is off by as much.
FIRST_FITS: Final = ((0.1, 1 / 8, 1.5), (0.2, 1 / 24, 1.2))
WIDTH_SIGMA: Final = 0.3
# The least blur of a sharp image, over that. Chosen: half a pixel, as the least of BLURS.
SHARP: Final = 0.4
# Blurs [px] that are tried at last. Chosen: an error of 20 % moves both edges alike.
BLURS: Final = (0.5, 0.7, 1.0, 1.4, 2.0, 2.8)
# A section is rejected below this fraction of the median contrast, and beyond this many robust
# scatters of its width or centre, which are at least LEAST_SIGMA. Chosen.
MIN_RELATIVE_CONTRAST, REJECTED = 0.2, 5.0
# Tangent of the angle by which a beam may turn between its last section and the mark. Chosen.
END_TURN: Final = 0.25
# Error of a path of the search [px], and over its width: the larger one. As `beam_paths` states.
PATH_ERROR_PX, PATH_ERROR_WIDTHS = 1.0, 0.25
# Least contrast [gray] of an edge, and of a path. Chosen: several times that of rounding.
MIN_CONTRAST: Final = 2.0
# Least sigma [px]. Measured on drawn beams without grain or texture.
LEAST_SIGMA: Final = 0.02
# Sections over which the scatter is computed. Chosen: a third of the fewest.
_LOCAL: Final = np.int64(31)
# A section is kept if most of this many about it are. Chosen.
_NEIGHBOURS: Final = np.int64(5)
_NO_POINTS: Final = np.zeros((0, 2))


class Rejection(StrEnum):
    """Reason for which a section of a beam has no point."""

    FAINT = "faint"
    HIDDEN = "hidden"
    OUTLIER = "outlier"

    @property
    def sentence(self) -> str:
        """Describe the reason."""
        return {
            Rejection.FAINT: "an edge has too little contrast",
            Rejection.HIDDEN: "the edges are not at the beam's width: something covers one",
            Rejection.OUTLIER: "the middle of the edges is off the smooth line",
        }[self]


class TracedBeam(NamedTuple):
    """Centreline of a beam in a photograph: n points from the clamp to the tip.

    `points` (n, 2) [px] are in the middle of the two edges; `normals` (n, 2) are unit vectors,
    `sigmas` (n,) [px] standard errors along them, `widths` (n,) [px] those of the beam.
    `shift_sigma` [px] is the standard error of a shift of all points across the beam together.
    `rejected` (m, 2) [px] are places without a point, on a smooth line through the others, and
    `reasons` (m,) the Rejection of each. `ends` (2, 2) [px] are the marks of clamp and tip, moved
    across the beam to the line, which is extended straight.
    """

    points: Floats
    normals: Floats
    sigmas: Floats
    widths: Floats
    shift_sigma: float = 0.0
    rejected: Floats = _NO_POINTS
    reasons: tuple[Rejection, ...] = ()
    ends: Floats = _NO_POINTS


class BeamFit(NamedTuple):
    """Edges of a beam in n sections; `reasons` (n,) are those of rejected ones, else ""."""

    sections: Sections
    pairs: EdgePairs
    reasons: npt.NDArray[np.str_]

    @property
    def kept(self) -> Mask:
        """Mask (n,) of the sections with two undisturbed edges."""
        return np.asarray(self.reasons == "")

    @property
    def enough(self) -> bool:
        """Whether there are LEAST_POINTS points."""
        return bool(np.count_nonzero(self.kept) >= LEAST_POINTS)

    @property
    def centres(self) -> Floats:
        """Middle of the edges (n, 2) [px]."""
        return self.sections.points + self.pairs.centre[:, None] * self.sections.normals

    def off_marks(self, marks: Floats, reach: float) -> Floats:
        """Compute how far the line, extended straight, is off the marks (2, 2), over `reach` [px].

        The allowed distance increases with that of the last section from the mark. The results (2,)
        are infinite without enough sections.
        """
        if not self.enough:
            return np.full(2, np.inf)
        ends = np.flatnonzero(self.kept)[[0, -1]]
        gap = np.linalg.norm(self.ends(marks) - self.centres[ends], axis=1)
        off = np.linalg.norm(self.ends(marks) - marks, axis=1)
        return np.asarray(off / (reach + END_TURN * gap))

    def off_path(self, path: BeamPath, chord: Chord) -> float:
        """Compute how far the line is off the path of the search, over the path's own error."""
        if not self.enough:
            return math.inf
        x, y = chord.places(self.centres[self.kept])
        off = np.abs(y - np.interp(x, *chord.places(path.points)))
        return float(np.median(off)) / max(PATH_ERROR_PX, PATH_ERROR_WIDTHS * path.width)

    def ends(self, marks: Floats) -> Floats:
        """Move the marks (2, 2) across the beam to the line, which is extended straight."""
        ends = np.flatnonzero(self.kept)[[0, -1]]
        normals = self.sections.normals[ends]
        off = np.sum((marks - self.centres[ends]) * normals, axis=1)
        return np.asarray(marks - off[:, None] * normals)

    def moved(self, chord: Chord) -> tuple[Sections, Floats]:
        """Move the sections to the middle of the edges; return them with the course of the width.

        Places of sections that are not kept are between, or beyond, those of others.
        """
        at, kept = self.sections.x, self.kept
        moved = chord.sections(*chord.places(self.centres[kept]), at)
        return moved, course(at[kept], self.pairs.width[kept], at, TAPER)

    def traced(self, marks: Floats) -> TracedBeam:
        """Compute points and sigmas of the sections that are kept; `marks` (2, 2) are the ends."""
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
        between = course(x, centre, sections.x[~kept], FINE_DEGREE)
        return TracedBeam(
            points=self.centres[kept],
            normals=sections.normals[kept],
            sigmas=scatter * np.sqrt(inflation),
            widths=width,
            shift_sigma=float(np.median(scatter)) * math.sqrt(max(together, inflation) / len(x)),
            rejected=sections.points[~kept] + between[:, None] * sections.normals[~kept],
            reasons=tuple(Rejection(reason) for reason in self.reasons[~kept]),
            ends=self.ends(marks),
        )


def first_fit(image: Image, path: BeamPath, chord: Chord, length: float) -> BeamFit:
    """Fit both edges along a path, which moves to their middle.

    Where an image is sharper than the blur of the fit, the edges of a thin beam are outliers to it,
    and it leaves the path: it is then fitted again with less blur.
    """
    blurred = _first_fit(image, path, chord, length, 1.0)
    if blurred.off_path(path, chord) <= 1:
        return blurred
    sharp = _first_fit(image, path, chord, length, SHARP)
    return min(blurred, sharp, key=lambda fit: fit.off_path(path, chord))


def _first_fit(
    image: Image, path: BeamPath, chord: Chord, length: float, sharpness: float
) -> BeamFit:
    at = section_places(length, path.width)
    sections = chord.sections(*chord.places(path.points), at)
    widths = np.full(len(at), path.width)
    for width_sigma, relative_blur, least_blur in FIRST_FITS:
        blur = max(relative_blur * path.width, sharpness * least_blur)
        pairs = _edges(image, sections, widths, width_sigma, blur)
        fit = BeamFit(sections, pairs, _reasons(pairs, sections))
        if not fit.enough:
            break
        sections, widths = fit.moved(chord)
    return fit


def final_fit(image: Image, first: BeamFit, chord: Chord) -> BeamFit:
    """Fit both edges with the blur that leaves the least residuals."""
    sections, widths = first.moved(chord)
    fits = [_edges(image, sections, widths, WIDTH_SIGMA, blur) for blur in BLURS]
    pairs = min(fits, key=lambda fit: float(np.median(fit.misfit)))
    return BeamFit(sections, pairs, _reasons(pairs, sections))


def _edges(
    image: Image, sections: Sections, widths: Floats, width_sigma: float, blur: float
) -> EdgePairs:
    """Fit the edges in all sections, with a `width_sigma` relative to the width."""
    width = float(np.median(widths))
    profiles, across = sections.profiles(image, width)
    return edge_pairs(profiles, across, -widths / 2, widths / 2, width_sigma * width, blur)


def _reasons(pairs: EdgePairs, sections: Sections) -> npt.NDArray[np.str_]:
    """Return the reasons (n,) for which sections are rejected, "" for undisturbed edges."""
    contrast = pairs.contrast.min(axis=1)
    least = max(MIN_RELATIVE_CONTRAST * float(np.median(contrast)), MIN_CONTRAST)
    reasons = np.where(contrast > least, "", Rejection.FAINT.value).astype("U8")
    for values, degree, reason in (
        (pairs.width, TAPER, Rejection.HIDDEN),
        (pairs.centre, FINE_DEGREE, Rejection.OUTLIER),
    ):
        kept = reasons == ""
        if np.any(kept):
            off = np.abs(values - course(sections.x[kept], values[kept], sections.x, degree))
            largest = max(SIGMA_OVER_MAD * float(np.median(off[kept])), LEAST_SIGMA)
            reasons[kept & (off >= REJECTED * largest)] = reason.value
    # One of a shadow's edges may be where the beam's would be, but rarely twice.
    kept = reasons == ""
    alone = kept & (running_median(kept.astype(float), _NEIGHBOURS) == 0)
    reasons[alone] = Rejection.OUTLIER.value
    return reasons
