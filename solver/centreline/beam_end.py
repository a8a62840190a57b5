"""Image of the beam's free end, and the fit of its place to the pixels about it.

The beam ends flat, with a disc. The camera sees the rim of it that is nearest, half an ellipse.
Across the beam, the brightness is that of the profile up to there; the lens blurs the end as it
blurs the sides, and the pixels average this image. The place of the end is the mean of its outline
over the beam's width.
"""

import math
from typing import Final, NamedTuple

import numpy as np

from solver.centreline.blurred_edge import blurred_edge
from solver.centreline.noise import Noise, pixel_variance
from solver.centreline.profile import STEP
from solver.instrument.arrays import Floats, Grey
from solver.instrument.compiled import FAST, njit
from solver.instrument.small_matrices import solve

# Mean extent of half an ellipse along its axis, over the half axis. Derived.
MEAN_BULGE: Final = math.pi / 4
# Places along each side of a pixel at which the brightness is evaluated. Measured: with twice as
# many, the end moves by 0.0011 px (root mean square; the largest of 117 changes was 0.006 px).
FINE: Final = 8
# Smallest blur [px] along the beam. Chosen: the sharpest image has no exact zero.
MIN_SPREAD_PX: Final = 0.005
# Pixels that are fitted, beyond the end's extent and these sigmas of the blur, along the beam and
# across it. Chosen: they contain the end and its background, and little else.
MARGIN_PX: Final = 2
BLUR_SIGMAS: Final = 2.0
# Sigma of the outline's half axis along the beam, over the radius. Chosen: the end of a beam that
# bends out of plane C climbs by this sine.
BULGE_SIGMA: Final = 0.1
# Sigma of the width over that at rest. Chosen: a beam that bends towards the camera looks wider.
WIDTH_SIGMA: Final = 0.05
# Largest number of steps, the last step and the longest one [px]. Chosen.
MAX_STEPS: Final = 8
TOLERANCE_PX: Final = 1e-4
MAX_STEP_PX: Final = 0.5
# Parameters of the fit. The background is a straight line across the beam.
_PARAMETERS: Final = 6
END, AMPLITUDE, BACKGROUND, SLOPE, BULGE, WIDTH = range(_PARAMETERS)


class StraightBeam(NamedTuple):
    """A straight beam near its end, whose pixel columns (rows unless `upright`) are read.

    Its axis is at climb x column + `level` [px], and `forward`, 1 or -1, is its direction along the
    columns.
    """

    climb: float
    level: float
    forward: float
    upright: bool

    def pixels(self, along: Floats) -> Floats:
        """Return the pixels (n, 2) of the axis at places `along` (n,) the columns."""
        axes = [along, self.climb * along + self.level]
        return np.column_stack(axes if self.upright else axes[::-1])


class BeamEnd(NamedTuple):
    """How the end appears.

    `brightness` (n,) [1/px] across the beam has unit area, on a grid of STEP [px] about the axis,
    towards larger pixel coordinates; `spread` [px] is the sigma of the blur. The outline is half an
    ellipse with the half axes `radius` [px] across the beam and `bulge` [px] along it.
    """

    brightness: Floats
    spread: float
    radius: float
    bulge: float


class Light(NamedTuple):
    """The beam's `amplitude` [gray px] before its end, its `sigma`, and the background [gray]."""

    amplitude: float
    sigma: float
    background: float


class EndFit(NamedTuple):
    """Fitted end: its place along the columns [px], variance [px^2], chi^2 and its dof.

    The variance is infinite where the pixels do not determine the end.
    """

    along: float
    variance: float
    chi2: float
    dof: int


@njit
def fit_end(
    image: Grey,
    line: StraightBeam,
    end: BeamEnd,
    start: float,
    light: Light,
    noise: Noise,
    full_scale: int,
) -> EndFit:
    """Fit the end of a beam from a `start` along the columns, where its light before is known.

    Pixels of `full_scale` or more are left out.
    """
    nothing = EndFit(start, np.inf, 0.0, 0)
    p = np.array([start, light.amplitude, light.background, 0.0, end.bulge, 1.0])
    normal, right = np.empty((_PARAMETERS, _PARAMETERS)), np.empty(_PARAMETERS)
    chi2, used = 0.0, 0
    for step in range(MAX_STEPS + 1):
        chi2, used = _normal_equations(
            image, line, end, start, light, noise, full_scale, p, normal, right
        )
        if used < _PARAMETERS + 2:
            return nothing
        if step == MAX_STEPS:
            break
        if not solve(normal.copy(), right):
            return nothing
        right[END] = min(max(right[END], -MAX_STEP_PX), MAX_STEP_PX)
        p += right
        if abs(p[END] - start) > MARGIN_PX:
            return nothing
        if abs(right[END]) < TOLERANCE_PX:
            break
    variance = np.zeros(_PARAMETERS)
    variance[END] = 1.0
    if not solve(normal, variance) or not variance[END] > 0:
        return nothing
    return EndFit(p[END], variance[END], chi2, used - _PARAMETERS)


@njit
def _normal_equations(
    image: Grey,
    line: StraightBeam,
    end: BeamEnd,
    start: float,
    light: Light,
    noise: Noise,
    full_scale: int,
    p: Floats,
    normal: Floats,
    right: Floats,
) -> tuple[float, int]:
    """Write the normal equations of parameters p; return chi^2 and the number of pixels.

    There are no pixels where they reach beyond the image.
    """
    normal[:], right[:] = 0.0, 0.0
    for k, expected, sigma in (
        (AMPLITUDE, light.amplitude, light.sigma),
        (BULGE, end.bulge, BULGE_SIGMA * end.radius),
        (WIDTH, 1.0, WIDTH_SIGMA),
    ):
        normal[k, k] = sigma**-2
        right[k] = (expected - p[k]) * normal[k, k]
    stretch = math.hypot(1.0, line.climb)
    blurred = BLUR_SIGMAS * end.spread
    beside = int(np.ceil((end.radius + blurred) * stretch)) + MARGIN_PX
    reach = int(np.ceil(end.bulge + blurred)) + MARGIN_PX
    first = int(np.rint(start)) - reach
    middle = int(np.rint(line.climb * np.rint(start) + line.level))
    height, width = image.shape if line.upright else image.shape[::-1]
    if not (0 <= first < width - 2 * reach and beside <= middle < height - beside):
        return 0.0, 0
    slopes = np.empty(_PARAMETERS)
    chi2, used = 0.0, 0
    for u in range(first, first + 2 * reach + 1):
        for v in range(middle - beside, middle + beside + 1):
            gray = float(image[v, u] if line.upright else image[u, v])
            if gray >= full_scale:
                continue
            covered = _pixel(line, end, u, v, p, slopes)
            slopes[AMPLITUDE], slopes[BACKGROUND], slopes[SLOPE] = covered, 1.0, v - middle
            model = p[AMPLITUDE] * covered + p[BACKGROUND] + p[SLOPE] * (v - middle)
            weight = 1.0 / pixel_variance(noise, max(model, 0.0))
            chi2 += weight * (gray - model) ** 2
            used += 1
            for k in range(_PARAMETERS):
                right[k] += weight * slopes[k] * (gray - model)
                for m in range(_PARAMETERS):
                    normal[k, m] += weight * slopes[k] * slopes[m]
    return chi2, used


@njit(fastmath=FAST)
def _pixel(
    line: StraightBeam, end: BeamEnd, column: int, row: int, p: Floats, slopes: Floats
) -> float:
    """Average the beam's brightness over a pixel; write the derivatives by end, bulge and width."""
    stretch, blur = math.hypot(1.0, line.climb), max(end.spread, MIN_SPREAD_PX)
    middle, size, cell = len(end.brightness) // 2, FINE * FINE, 1 / (FINE * stretch)
    value = by_end = by_bulge = by_width = 0.0
    slopes[END] = slopes[BULGE] = slopes[WIDTH] = 0.0
    # Most pixels are beside the beam, and show none of its light.
    extent = (end.radius * p[WIDTH] + 5 * end.spread + 1) * stretch
    if abs(row - (line.climb * column + line.level)) > extent:
        return 0.0
    for i in range(FINE):
        u = column + (i + 0.5) / FINE - 0.5
        for j in range(FINE):
            v = row + (j + 0.5) / FINE - 0.5
            beside = v - (line.climb * u + line.level)
            across = beside / stretch / p[WIDTH]
            place = across / STEP + middle
            k = int(np.floor(place))
            if not 0 <= k < len(end.brightness) - 1:
                continue
            rise = end.brightness[k + 1] - end.brightness[k]
            light = (end.brightness[k] + (place - k) * rise) / p[WIDTH]
            x = across / end.radius
            outline = math.sqrt(max(1 - x * x, 0.0)) - MEAN_BULGE
            # The distance before the end, along the beam.
            before = line.forward * ((p[END] - u) * stretch - line.climb * beside / stretch)
            covered, slope = blurred_edge((before + p[BULGE] * outline) / cell, blur / cell)
            density = slope / cell
            value += light * covered
            by_end += light * density * line.forward * stretch
            by_bulge += light * density * outline
            by_width -= (light + across / STEP * rise / p[WIDTH]) / p[WIDTH] * covered
    slopes[END] = p[AMPLITUDE] * by_end / size
    slopes[BULGE] = p[AMPLITUDE] * by_bulge / size
    slopes[WIDTH] = p[AMPLITUDE] * by_width / size
    return value / size
