"""Detection of camera motion since the rest images, by landmarks that are fixed in the image.

The clamp's edge, a fixed mark and the texture of the ground keep their place in the image unless
the camera moves. The strongest gradients of the rest images outside the beam are kept as landmarks.
The shift of an image against them is estimated by robust least squares on gray values (Lucas and
Kanade 1981; Tukey's biweight), together with a gain of the light. Both images are smoothed by the
cubic B-spline that interpolates between pixels (Unser 1999): an edge that is sharper than a pixel
changes by jumps as it moves, and its pixels would be rejected as outliers.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

from solver.at_rest.thresholds import THRESHOLDS
from solver.centreline.noise import Noise, mean_image
from solver.instrument.arrays import Floats, Grey
from solver.instrument.compiled import njit
from solver.instrument.medians import SIGMA_OVER_MAD, TUKEY_CUT, median
from solver.instrument.small_matrices import solve_definite, whitening

# Number of landmarks kept, the strongest ones: a thousand pixels cost 0.05 ms per image.
MAX_LANDMARKS = 1000
# Fewest landmarks for the detection of a shift. Chosen: ten for each unknown, because their
# agreement is judged by the residuals.
MIN_LANDMARKS = 30
# Least sigma [gray levels] in processed images, whose errors are shared within a block; chosen.
PROCESSED_ERROR = 1.0
# Cubic B-spline at whole pixels, and its derivative between them.
SMOOTH = np.array([1, 4, 1]) / 6
ALONG = np.array([-1, 0, 1]) / 2
# Variance of the smoothed gradient of white noise. Derived: the sum of the squares of its weights.
NOISE_GAIN = float((SMOOTH**2).sum() * (ALONG**2).sum())
# Largest shift searched [px], and the margin at the image's border that such a shift may push out
# of it.
FARTHEST = 6
# Largest sigma [px] at which a shift is measured: three sigmas are within the search range.
MAX_MEASURED_SIGMA_PX = FARTHEST / 3
STEPS = 8
# Spacing [px] of the pixels from which the light of the whole image is estimated, and their least
# gray value at rest; chosen.
GRID = 8
DARKEST = 1.0
# Rows and columns of a block, a macroblock of video. Where an image differs from the rest images by
# more than noise, through compression or light, the errors of a block are correlated.
BLOCK = 16


class ImageShift(NamedTuple):
    """Shift (2,) [px] of an image along its rows and down, and its covariance (2, 2) [px^2]."""

    shift: Floats
    covariance: Floats

    def exceeds(self, sigma_px: float) -> bool:
        """Return whether the shift exceeds three sigmas, where shifts of `sigma_px` are usual."""
        (du, dv), ((uu, uv), (_, vv)) = self.shift, self.covariance
        usual_variance = THRESHOLDS.steadiness_px**2 + sigma_px**2
        uu, vv = uu + usual_variance, vv + usual_variance
        # Squared Mahalanobis distance, with the inverse of the covariance written out.
        distance2 = vv * du**2 - 2 * uv * du * dv + uu * dv**2
        return bool(distance2 > THRESHOLDS.moved_chi2 * (uu * vv - uv**2))


def with_prior(measured: ImageShift | None, sigma_px: float) -> ImageShift:
    """Combine a measured shift with the prior, which has the sigma `sigma_px` in each direction.

    Shadows and reflections move the landmarks a little, too. Where nothing was measured, the prior
    remains.
    """
    prior = np.eye(2) * sigma_px**2
    if measured is None:
        return ImageShift(np.zeros(2), prior)
    error = measured.covariance + np.eye(2) * THRESHOLDS.steadiness_px**2
    gain = prior @ np.linalg.inv(prior + error)
    covariance = prior - gain @ prior
    return ImageShift(gain @ measured.shift, (covariance + covariance.T) / 2)


class Pixels(NamedTuple):
    """n pixels (rows, columns) with their gray values, gradients [gray/px] and sigmas at rest."""

    rows: npt.NDArray[np.int64]
    columns: npt.NDArray[np.int64]
    gray: Floats
    along_u: Floats
    along_v: Floats
    sigma: Floats


class _Match(NamedTuple):
    """Shift (du, dv) [px] with its covariance, share of agreeing landmarks, scatter in sigmas.

    `gain` is the landmarks' light over that of the rest images.
    """

    du: float
    dv: float
    uu: float
    uv: float
    vv: float
    agreeing: float
    scatter: float
    gain: float


@dataclass(frozen=True)
class Landmarks:
    """The landmarks' pixels at rest, and what limits the detection of a shift.

    In `processed` images the errors of a block are correlated. Noise in the gradients adds
    `noise_information` to the expected (gradient over sigma)^2 [1/px^2]. `mean` (rows, columns)
    [gray] is every GRID-th pixel of the rest images.
    """

    pixels: Pixels
    processed: bool
    noise_information: float
    mean: Floats

    @property
    def known(self) -> bool:
        """Whether a shift of half a pixel in any direction would be detected."""
        return self.shift_sigma < THRESHOLDS.known_sigma_px

    @cached_property
    def shift_sigma(self) -> float:
        """Sigma [px] of a shift in its least certain direction; may be infinite."""
        information = np.zeros((2, 2))
        gradients = (self.pixels.along_u, self.pixels.along_v)
        for i, a in enumerate(gradients):
            for j, b in enumerate(gradients):
                information[i, j] = float(np.sum(a * b / self.pixels.sigma**2))
        # Twice the expected value: selecting the strongest gradients favours those raised by noise.
        min_information = (
            float(np.linalg.eigvalsh(information)[0])
            - 2 * len(self.pixels.rows) * self.noise_information
        )
        return (
            math.sqrt(self._correlated_pixels / min_information)
            if min_information > 0
            else math.inf
        )

    def shift_of(self, image: Grey) -> ImageShift | None:
        """Measure the shift of an image (height, width); return None if the landmarks disagree.

        They also disagree if their light has changed otherwise than that of the whole image: the
        shadow of an object lies on them, and its edge looks like a shift.
        """
        if len(self.pixels.rows) < MIN_LANDMARKS or self.shift_sigma > MAX_MEASURED_SIGMA_PX:
            return None
        match = _shift(image, self.pixels)
        if not (match.agreeing >= THRESHOLDS.min_share and match.scatter <= THRESHOLDS.max_scatter):
            return None
        light = median((image[::GRID, ::GRID] / self.mean).ravel())
        if abs(match.gain - light) > THRESHOLDS.max_shade * light + self._rounding:
            return None
        # The median of n independent |x| exceeds this by chance in one image of a thousand.
        usual_scatter = 1 + 3.1 * 1.17 / math.sqrt(len(self.pixels.rows))
        inflation = 1 + max(match.scatter**2 - usual_scatter**2, 0.0) * self._pixels_per_block
        inflation = max(inflation, self._correlated_pixels)
        covariance = np.array([[match.uu, match.uv], [match.uv, match.vv]])
        return ImageShift(np.array([match.du, match.dv]), inflation * covariance)

    @cached_property
    def _rounding(self) -> float:
        """Largest error of the light where all gray values are rounded alike."""
        return 0.5 / median(self.mean.ravel())

    @property
    def _correlated_pixels(self) -> float:
        return self._pixels_per_block if self.processed else 1.0

    @cached_property
    def _pixels_per_block(self) -> float:
        blocks = np.unique(
            np.column_stack([self.pixels.rows, self.pixels.columns]) // BLOCK, axis=0
        )
        return len(self.pixels.rows) / max(len(blocks), 1)


def learn_landmarks(images: Sequence[Grey], beam: Floats, width: float, noise: Noise) -> Landmarks:
    """Choose landmarks in images (height, width) of the beam at rest.

    `beam` (n, 2) [px] is a path along the beam, from before its clamp to beyond its tip; a band of
    `width` [px] about it is left out.
    """
    mean = mean_image(images)
    smooth, along_u, along_v = (
        np.asarray(cv2.sepFilter2D(mean, cv2.CV_64F, *kernels), np.float64)
        for kernels in ((SMOOTH, SMOOTH), (ALONG, SMOOTH), (SMOOTH, ALONG))
    )
    # The mean of the rest images has noise, too.
    sigma = np.sqrt(noise.variance(mean) * (1 + 1 / len(images)))
    processed = noise.processed(images[0])
    if processed:
        sigma = np.maximum(sigma, PROCESSED_ERROR)
    usable = np.zeros(mean.shape, np.uint8)
    margin = FARTHEST + 2
    usable[margin:-margin, margin:-margin] = 1
    path = np.rint(beam).astype(np.int32).reshape(-1, 1, 2)
    cv2.polylines(usable, [path], isClosed=False, color=0, thickness=max(math.ceil(width), 1))
    strength = np.where(usable, np.hypot(along_u, along_v) / sigma, 0.0).ravel()
    strongest = np.argsort(strength)[::-1][:MAX_LANDMARKS]
    selected = np.sort(strongest[strength[strongest] > THRESHOLDS.min_gradient])
    rows, columns = np.divmod(selected, mean.shape[1])
    pixels = Pixels(
        rows,
        columns,
        smooth.ravel()[selected],
        along_u.ravel()[selected],
        along_v.ravel()[selected],
        sigma.ravel()[selected],
    )
    grid = np.maximum(mean[::GRID, ::GRID], DARKEST)
    return Landmarks(pixels, processed, NOISE_GAIN / (len(images) + 1), grid)


@njit
def _shift(image: Grey, pixels: Pixels) -> _Match:
    """Measure the shift of an image (height, width), coarsely first if it is large."""
    match = _refined(image, pixels, 0.0, 0.0)
    if match.agreeing >= THRESHOLDS.min_share and match.scatter <= THRESHOLDS.max_scatter:
        return match
    # At large shifts the edges no longer overlap: the best whole pixel is searched first.
    rows, columns, gray, _, _, sigma = pixels
    best, best_u, best_v = np.inf, 0, 0
    for v in range(-FARTHEST, FARTHEST + 1):
        for u in range(-FARTHEST, FARTHEST + 1):
            cost = 0.0
            for i in range(len(rows)):
                off = (image[rows[i] + v, columns[i] + u] - gray[i]) / sigma[i]
                cost += min(abs(off), 20.0)
            if cost < best:
                best, best_u, best_v = cost, u, v
    return _refined(image, pixels, float(best_u), float(best_v))


@njit
def _cubic(t: float, weight: Floats) -> None:
    """Compute weights (4,) of the cubic B-spline at t in 0 to 1 between the middle two."""
    r = 1 - t
    weight[0], weight[3] = r * r * r / 6, t * t * t / 6
    weight[1] = 2 / 3 - t * t * (1 - t / 2)
    weight[2] = 2 / 3 - r * r * (1 - r / 2)


@njit
def _refined(  # noqa: PLR0912 - one loop over the landmarks, written out for speed
    image: Grey, pixels: Pixels, du: float, dv: float
) -> _Match:
    """Refine (du, dv) by Gauss-Newton."""
    rows, columns, gray, along_u, along_v, sigma = pixels
    n = len(rows)
    residual, row = np.empty(n), np.empty(3)
    normal, right, white = np.zeros((3, 3)), np.zeros(3), np.zeros((3, 3))
    down, across = np.empty(4), np.empty(4)
    gain, scatter = 1.0, 1.0
    unknown = _Match(du, dv, np.inf, 0.0, np.inf, 0.0, np.inf, gain)
    for _ in range(STEPS):
        for i in range(n):
            v, u = rows[i] + dv, columns[i] + du
            r, c = int(np.floor(v)), int(np.floor(u))
            if r < 1 or c < 1 or r + 2 >= image.shape[0] or c + 2 >= image.shape[1]:
                return unknown
            _cubic(v - r, down)
            _cubic(u - c, across)
            seen = 0.0
            for j in range(4):
                for k in range(4):
                    seen += down[j] * across[k] * image[r - 1 + j, c - 1 + k]
            residual[i] = (seen - gain * gray[i]) / sigma[i]
        scatter = SIGMA_OVER_MAD * median(np.abs(residual))
        cut = TUKEY_CUT * max(scatter, 1.0)
        normal[:] = 0.0
        right[:] = 0.0
        for i in range(n):
            w = 1 - (residual[i] / cut) ** 2
            if w <= 0:
                continue
            w *= w
            row[0], row[1] = -along_u[i] / sigma[i], -along_v[i] / sigma[i]
            row[2] = gray[i] / sigma[i]
            for p in range(3):
                right[p] += w * row[p] * residual[i]
                for q in range(3):
                    normal[p, q] += w * row[p] * row[q]
        for p in range(3):
            normal[p, p] = normal[p, p] * (1 + 1e-9) + 1e-12
        white = whitening(normal)
        if not solve_definite(normal, right):
            return unknown
        du += min(max(right[0], -1.0), 1.0)
        dv += min(max(right[1], -1.0), 1.0)
        gain += right[2]
        if abs(du) > FARTHEST + 1 or abs(dv) > FARTHEST + 1:
            return unknown
        if abs(right[0]) + abs(right[1]) < 1e-3:
            break
    if not 1 / THRESHOLDS.max_gain < gain < THRESHOLDS.max_gain:
        return unknown
    agreeing = 0
    for i in range(n):
        agreeing += abs(residual[i]) < TUKEY_CUT * max(scatter, 1.0)
    uu = uv = vv = 0.0
    for k in range(3):  # the covariance is the whitening matrix's transpose times itself
        uu += white[k, 0] ** 2
        uv += white[k, 0] * white[k, 1]
        vv += white[k, 1] ** 2
    return _Match(du, dv, uu, uv, vv, agreeing / n, scatter, gain)
