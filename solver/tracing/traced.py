"""Centreline of a beam in one photograph, from marks of its clamp and tip."""

import math
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from solver.instrument.arrays import Floats
from solver.instrument.errors import InputError
from solver.instrument.images import ALL_CHANNELS, CHANNELS, read_channels
from solver.tracing.beam_fit import (
    LEAST_POINTS,
    MIN_CONTRAST,
    BeamFit,
    TracedBeam,
    final_fit,
    first_fit,
)
from solver.tracing.equal_noise import Image, equal_noise
from solver.tracing.path_search import NEAR_MARK, UNKNOWN, Search, beam_paths
from solver.tracing.sections import Chord

# Channels of a photograph that may be traced: all of its colours, or one.
TRACE_CHANNELS: Final = (ALL_CHANNELS, *CHANNELS)
# Shortest beam [px]: half a pixel for each of the fewest sections. Measured: the errors of 60 drawn
# beams of 40 to 120 px do not depend on the length.
LEAST_LENGTH: Final = 40
# Smallest support of a path that is a beam. Measured: paths along texture or along a single edge
# reach a support of 0.2, those of drawn beams and of cables begin at 0.7.
MIN_SUPPORT: Final = 0.4
# Largest motion of a beam's end from image to image, over the length. Chosen: that of a beam which
# returns to rest; at 0.3 another one beside it would be traced.
FAR: Final = 0.15
# Least certainty of a wider beam over that of the most certain one. Chosen: edges of 0.6 times the
# contrast have it, at 0.2 the edges of two beams count as one.
MIN_CERTAINTY: Final = 0.36


def photograph(path: Path, channel: str = ALL_CHANNELS) -> Image:
    """Read a photograph: all channels (height, width, 3), or one (height, width), as gray values.

    `channel` is one of TRACE_CHANNELS; a gray image has one channel. Pixels are used as they are
    stored: an orientation tag (EXIF) is ignored, as everywhere, and marks refer to the stored
    pixels. Raises InputError if the file is not an image.
    """
    return read_channels(path, channel).astype(np.float32)


def trace(
    image: npt.ArrayLike,
    start: tuple[float, float],
    end: tuple[float, float],
    *,
    previous: TracedBeam | None = None,
) -> TracedBeam:
    """Trace a beam, wire, cable or whisker from `start` to `end` [px] in an image, without a rig.

    `image` is (height, width) or (height, width, 3). `start` and `end` are pixels (u, v), integer
    at pixel centres, which need to be known to a few pixels. In the images after the first,
    `previous` is the beam in the image before: its ends replace `start` and `end`, and its width is
    searched for. Where no beam is within 8 px of both ends, one within 0.15 of the length is
    traced. Otherwise as `traced_beam`. Raises InputError where no beam is found, and for an image
    of another shape or with pixels that are not finite.

    >>> import solver
    >>> beam = solver.trace(image, (40, 90), (600, 130))  # doctest: +SKIP
    >>> beam.points, beam.sigmas, beam.rejected, beam.reasons  # doctest: +SKIP
    """
    pixels = np.asarray(image)
    if pixels.ndim not in (2, 3) or pixels.shape[2:] not in ((), (3,)) or not pixels.size:
        raise InputError(
            f"the image has shape {pixels.shape}, allowed are (height, width) and "
            "(height, width, 3)"
        )
    if not np.isfinite(pixels).all():
        raise InputError("the image holds pixels that are no numbers, or not finite")
    names = ("start", "end")
    if previous is None:
        return traced_beam(pixels, np.asarray(start), np.asarray(end), names)
    (first, last), width = previous.ends, float(np.median(previous.widths))
    try:
        return traced_beam(pixels, first, last, names, Search(NEAR_MARK, width))
    except InputError:
        return traced_beam(pixels, first, last, names, Search(FAR * math.dist(first, last), width))


def traced_beam(
    image: npt.NDArray[Any],
    clamp_px: Floats,
    tip_px: Floats,
    names: tuple[str, str] = ("clamp_px", "tip_px"),
    search: Search = UNKNOWN,
) -> TracedBeam:
    """Trace the beam from its clamp to its tip in an image (height, width) or (height, width, 3).

    `clamp_px` and `tip_px` (2,) [px] need to be known to a few pixels only; messages call them
    `names`. The beam may be 1 to 60 px wide; `search` is what is known of it. Each of its edges may
    have any contrast, in brightness or in colour, which may change along the beam. The errors of
    neighbouring points are correlated by grain and compression: the sigmas are larger than the
    scatter by the root of the correlation length, so that a fit to independent points has the right
    covariance. What is the same all along the beam, as light from one side, only shifts it:
    `shift_sigma`. Places at which an edge is hidden or disturbed are rejected. Raises InputError
    where no beam is found.
    """
    marks = np.array([clamp_px, tip_px], np.float64)
    _check_marks(image.shape, marks, names)
    where = " and ".join(f"{name} {_shown(mark)}" for name, mark in zip(names, marks, strict=True))
    channels = equal_noise(image)
    paths = beam_paths(channels, marks[0], marks[1], search)
    strong = [
        path for path in paths if path.support >= MIN_SUPPORT and path.contrast >= MIN_CONTRAST
    ]
    if not strong:
        best = max(paths, key=lambda path: path.support)
        raise InputError(
            f"no beam is found between {where}: the best path has two edges of "
            f"{max(best.contrast, 0):.1f} gray on {100 * best.support:.0f} % of its length, needed "
            f"are {MIN_CONTRAST:.1f} gray on {100 * MIN_SUPPORT:.0f} %"
        )
    length = math.dist(*marks)
    chord = Chord(marks[0], (marks[1] - marks[0]) / length)
    fits = [first_fit(channels, path, chord, length) for path in strong]
    apart = [fit.off_path(path, chord) for fit, path in zip(fits, strong, strict=True)]
    likeliest = _likeliest(fits, apart, marks, search.reach)
    fit = None if likeliest is None else final_fit(channels, likeliest, chord)
    if fit is None or fit.off_marks(marks, search.reach).max() > 1:
        raise InputError(
            f"no beam passes within {search.reach:.0f} px of both {where} with two undisturbed "
            f"edges in at least {LEAST_POINTS} sections"
        )
    return fit.traced(marks)


def _likeliest(
    fits: list[BeamFit], off_paths: list[float], marks: Floats, reach: float
) -> BeamFit | None:
    """Choose the widest beam about the most certain line: grain and highlights are within it.

    A line is certain by the information of its points, and by how near it is to the marks and to
    the path along which it was fitted: edges of too small a width slide to one side of a beam.
    Return None if none passes the marks.
    """
    far = [
        np.append(fit.off_marks(marks, reach), off)
        for fit, off in zip(fits, off_paths, strict=True)
    ]
    near = [i for i, off in enumerate(far) if off[:2].max() <= 1]
    if not near:
        return None
    fits = [fits[i] for i in near]
    beams = [fit.traced(marks) for fit in fits]
    certainty = np.array(
        [
            np.sum(beam.sigmas**-2.0) * np.exp(-np.sum(far[i] ** 2))
            for beam, i in zip(beams, near, strict=True)
        ]
    )
    widths = np.array([np.median(beam.widths) for beam in beams])
    line = cKDTree(beams[int(certainty.argmax())].points)
    apart = np.array([np.median(line.query(beam.points)[0]) for beam in beams])
    about = (certainty >= MIN_CERTAINTY * certainty.max()) & (apart < widths / 2)
    about[certainty.argmax()] = True
    return fits[int(np.argmax(np.where(about, widths, 0.0)))]


def _check_marks(shape: tuple[int, ...], marks: Floats, names: tuple[str, str]) -> None:
    """Raise InputError for marks outside the image, or too near to each other."""
    for name, mark in zip(names, marks, strict=True):
        if not (0 <= mark[0] < shape[1] and 0 <= mark[1] < shape[0]):
            raise InputError(
                f"{name} is {_shown(mark)}, allowed is a place in the image of "
                f"{shape[1]} x {shape[0]} px"
            )
    length = math.dist(*marks)
    if length < LEAST_LENGTH:
        raise InputError(
            f"{names[0]} {_shown(marks[0])} and {names[1]} {_shown(marks[1])} are {length:.0f} px "
            f"apart, allowed are at least {LEAST_LENGTH} px"
        )


def _shown(mark: Floats) -> str:
    return f"[{mark[0]:.1f}, {mark[1]:.1f}]"
