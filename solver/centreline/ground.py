"""The ground behind the beam: its structure, learned from the rest images.

A structured ground, such as felt, looks like beam in places. Where the camera does not move against
it, the mean of the rest images shows it everywhere except under the beam. There it is interpolated,
and the interpolation's error is measured where the ground is known.
"""

from collections.abc import Sequence
from typing import Final, NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

from solver.centreline.bare_ground import (
    SMOOTH_PX,
    BareGround,
    Lattice,
    Pattern,
    match,
    shifted,
    structured,
    thinned,
)
from solver.centreline.noise import Noise, mean_image
from solver.centreline.smooth import LAG, REST_DEGREE
from solver.centreline.thresholds import THRESHOLDS
from solver.instrument.arrays import Floats, Grey, Mask
from solver.instrument.compiled import njit
from solver.instrument.medians import median

# Step [px] of the lattice of columns in which the ground's structure is tested.
TEST_PX = 5
# The beam's ends are known to this [px].
END_MARGIN_PX = 1.0
# Farthest displacements of the band, in its widths, at which the interpolation's error is measured.
DISPLACEMENTS = (-4, -3, -2, 2, 3, 4)


class Grain(NamedTuple):
    """Number of pixels along the beam, and across it, that err as one.

    `smooth` is that along it for smooth courses, as the line of a beam at rest, into which errors
    that change their sign from square to square hardly go.
    """

    along: float
    across: float
    smooth: float


NO_GRAIN: Final = Grain(1.0, 1.0, 1.0)


class Ground(NamedTuple):
    """Gray values (height, width) of the ground without the beam, and their `variance`.

    `level` is their typical value. `fine` is the variance of the difference between two halves of a
    pixel: a pixel that the beam covers in part does not show its mean ground. `rows` and `columns`
    are pixels beside the beam that differ by more than noise from the `smooth` ground about them.
    `bare_images` counts the images without the beam that show it; 0 where it was interpolated. With
    them, `fine` is what the pixels beside do not predict of that difference. `grain` is that of
    these errors, which are `fine` with images without the beam, and those of the interpolation
    without.
    """

    gray: Pattern
    variance: Pattern
    level: float
    fine: float
    rows: npt.NDArray[np.int64]
    columns: npt.NDArray[np.int64]
    smooth: Floats
    bare_images: int = 0
    grain: Grain = NO_GRAIN

    def in_image(self, image: Grey, noise: Noise) -> "Ground":
        """Return the ground where an image (height, width) shows it.

        A ground that was interpolated under the beam stays where it is.
        """
        if not self.bare_images:
            return self
        lattice = Lattice(self.rows, self.columns)
        found = match(image, self.gray, lattice, noise, 1 / self.bare_images)
        if found is None or not found.is_shifted:
            return self
        return self._replace(gray=shifted(self.gray, found.shift))

    def gain(self, image: Grey) -> float | None:
        """Estimate the light's gain in an image since rest; None if it does not show this ground.

        The ground of the rest images must explain the lattice of pixels better than a smooth ground
        does: a ground that moves against the camera does not.
        """
        gain, known, unknown = _explained(
            image[self.rows, self.columns].astype(np.float64),
            self.gray[self.rows, self.columns].astype(np.float64),
            self.smooth,
        )
        return gain if known < unknown else None

    def subtracted(self, image: Grey, full_scale: int) -> Grey | None:
        """Subtract the ground's structure from an image (height, width), for the beam's detection.

        The result has the image's type; pixels at `full_scale` keep their value. It is None if the
        image does not show this ground.
        """
        gain = self.gain(image)
        if gain is None:
            return None
        flat = image - np.float32(gain) * (self.gray - np.float32(self.level))
        flat = np.clip(np.rint(flat), 0, full_scale).astype(image.dtype)
        return np.where(image >= full_scale, image, flat)


def learn_ground(
    images: Sequence[Grey],
    beam: Floats,
    reach: float,
    noise: Noise,
    half: int,
    bare: BareGround | None = None,
) -> Ground | None:
    """Learn the ground from images (height, width) of the beam at rest.

    `beam` (n, 2) [px] is a path along the beam, from its clamp to its tip; pixels within `reach`
    [px] of it show the beam.

    Return None if it has no structure that is worth subtracting: the mean of n images has noise,
    too, which costs 1 / (n + 1) of the information of every column. Structure costs the columns
    that it disturbs. `half` is that of the profile fit.
    """
    mean = mean_image(images)
    along, across = np.abs(beam[-1] - beam[0])
    # Rows cross an upright beam: the transposed image is read by columns.
    upright = along >= across
    gray = np.ascontiguousarray(mean if upright else mean.T)
    middle, stretch = _course(beam if upright else beam[:, ::-1], gray.shape[1])
    n = int(reach * stretch + 0.5)
    under = np.abs(np.arange(gray.shape[0])[:, None] - np.rint(middle)) <= n
    variance = noise.variance(gray)
    n_images = len(images)
    if bare is not None:
        gray = np.asarray(bare.gray if upright else bare.gray.T, np.float64)
        variance, n_images, under = noise.variance(gray), bare.images, np.zeros_like(under)
    disturbed = _disturbed_share(gray, variance / n_images, variance, under, half)
    if disturbed <= 1 / (n_images + 1):
        return None
    if bare is None:
        fine = _fine_variance(gray, variance / n_images, under)
        interpolated, error, grain = _interpolated(gray, middle, n)
        gray = np.where(under, interpolated, gray)
        variance = np.where(under, error, variance / n_images)
    else:
        fine, grain = _curved_variance(gray, variance / n_images)
        variance = variance / n_images
    if not upright:
        gray, variance, under = gray.T, variance.T, under.T
    blurred = cv2.GaussianBlur(np.ascontiguousarray(gray), (0, 0), SMOOTH_PX)
    if bare is None:
        rows, columns = thinned(~under & ((gray - blurred) ** 2 > noise.variance(gray)))
    else:
        rows, columns = structured(bare.gray, noise)
    return Ground(
        gray=np.ascontiguousarray(gray, np.float32),
        variance=np.ascontiguousarray(variance, np.float32),
        level=float(np.median(gray)),
        fine=fine,
        rows=rows,
        columns=columns,
        smooth=np.asarray(blurred[rows, columns], np.float64),
        bare_images=0 if bare is None else bare.images,
        grain=grain,
    )


def _course(beam: Floats, n: int) -> tuple[Floats, float]:
    """Compute the beam's position in each of n columns, NaN beside it, and how oblique it is.

    The position at the ends is also that of the columns within the margin beyond them.
    """
    along, across = beam[np.argsort(beam[:, 0])].T
    every = np.arange(n, dtype=np.float64)
    middle = np.interp(every, along, across)
    middle[(every < along[0] - END_MARGIN_PX) | (every > along[-1] + END_MARGIN_PX)] = np.nan
    return middle, float(np.hypot(1.0, (across[-1] - across[0]) / (along[-1] - along[0])))


def _disturbed_share(
    gray: Floats, mean_variance: Floats, variance: Floats, under: Mask, half: int
) -> float:
    """Compute the share of columns across a beam anywhere that the ground's structure disturbs.

    A column of 2 half + 1 pixels is disturbed if a straight line leaves it more than
    `max_misfit` times the noise of one image.
    """
    size = 2 * half + 1
    if gray.shape[0] < size:
        return 0.0
    sliding = np.lib.stride_tricks.sliding_window_view
    windows = sliding(gray, size, axis=0)[::TEST_PX, ::TEST_PX]
    beside = ~sliding(under, size, axis=0)[::TEST_PX, ::TEST_PX].any(axis=-1)
    x = np.linspace(-1, 1, size)
    basis = np.linalg.qr(np.column_stack([np.ones(size), x]))[0]
    windows = windows[beside]
    residual = windows - windows @ basis @ basis.T
    squares = np.einsum("nk,nk->n", residual, residual) / (size - 2)
    noise = sliding(variance, size, axis=0)[::TEST_PX, ::TEST_PX][beside].mean(axis=-1)
    mean_noise = sliding(mean_variance, size, axis=0)[::TEST_PX, ::TEST_PX][beside].mean(axis=-1)
    structure = squares - mean_noise
    return float(np.mean(structure > (THRESHOLDS.max_misfit - 1) * noise)) if len(windows) else 0.0


def _fine_variance(gray: Floats, mean_variance: Floats, under: Mask) -> float:
    """Extrapolate the variance of differences to the halves of a pixel, by its power law.

    The variance of differences across two pixels, over that across one, is 2 for a rough ground
    and 4 for a smooth one. The noise of the mean is subtracted.
    """
    variances = []
    for step in (1, 2):
        beside = ~(under[step:] | under[:-step])
        difference = (gray[step:] - gray[:-step])[beside]
        noise = (mean_variance[step:] + mean_variance[:-step])[beside]
        variances.append(max(float(np.mean(difference**2) - np.mean(noise)), 0.0))
    one, two = variances
    return one / min(max(two / one, 1.0), 4.0) if one > 0 else 0.0


def _curved_variance(gray: Floats, mean_variance: Floats) -> tuple[float, Grain]:
    """Extrapolate how the halves of a pixel differ from what the pixels beside it predict.

    The variance of this error is measured for pixels of twice and four times the size, whose halves
    are known. The noise of the mean is subtracted. Return it with its grain, which is measured for
    smooth courses.
    """
    variances, smooth = [], 1.0
    for size in (2, 4):
        n = len(gray) // size * size
        halves = gray[:n].reshape(-1, 2, size // 2, gray.shape[1]).mean(axis=2)
        noise = mean_variance[:n].reshape(-1, size, gray.shape[1]).mean(axis=1)
        means = halves.mean(axis=1)
        error = halves[1:-1, 1] - halves[1:-1, 0] - (means[2:] - means[:-2]) / 4
        # Of both halves, and of two pixels' means.
        noise = noise[1:-1] * (4 / size + 2 / size / 16)
        variances.append(max(float(np.mean(error**2) - np.mean(noise)), 0.0))
        if size == 2:
            smooth = _smooth_grain(error, float(np.mean(noise)))
    small, large = variances
    return small**2 / max(large, small, 1e-12), NO_GRAIN._replace(smooth=smooth)


def _grain_along(errors: Floats) -> float:
    """Estimate how many neighbours err as one, from errors (k, n) of n pixels along the beam.

    It is the variance of their mean over LAG pixels, over that of independent errors.
    """
    lags = np.arange(1, LAG)
    products = [np.mean(errors[:, :-lag] * errors[:, lag:]) for lag in lags]
    grain = 1 + 2 * float((LAG - lags) @ products) / (LAG * float(np.mean(errors**2)))
    return min(max(grain, 1.0), float(LAG))


def _smooth_grain(errors: Floats, noise: float = 0.0) -> float:
    """Estimate the variance that smooth courses have of errors (k, n), over independent ones.

    `noise` is the part of the variance that comes from independent errors of another kind.
    """
    place = np.linspace(-1, 1, errors.shape[1])
    courses = np.linalg.qr(np.polynomial.chebyshev.chebvander(place, int(REST_DEGREE)))[0]
    smooth, variance = np.mean((errors @ courses) ** 2), np.mean(errors**2)
    return max(float((smooth - noise) / max(variance - noise, 1e-12)), 1.0)


class _Band(NamedTuple):
    """Pixels (m, 2 n + 1) of a band: `rows`, `columns` (m, 1), gray values by interpolation.

    `step` (m, 1) is the square of the difference between the band's two sides.
    """

    rows: npt.NDArray[np.int64]
    columns: npt.NDArray[np.int64]
    gray: Floats
    step: Floats


class _Interpolated(NamedTuple):
    """The ground (height, width), its variance in the band, and the grain of its errors there."""

    gray: Floats
    variance: Floats
    grain: Grain


def _interpolated(gray: Floats, middle: Floats, n: int) -> _Interpolated:
    """Interpolate the ground (height, width) across n pixels on both sides of `middle` (width,).

    The variance is measured: the same interpolation is tried across the band displaced along the
    columns, where the ground is known. It has a part in proportion to the squared difference
    between the band's two sides: where they differ, an edge of the ground is between them.
    """
    columns = np.flatnonzero(np.isfinite(middle))
    course = np.rint(middle[columns]).astype(np.int64)
    tried = [_band(gray, columns, course + k * (2 * n + 3), n) for k in DISPLACEMENTS]
    step = np.concatenate([band.step for band in tried])
    errors = [gray[band.rows, band.columns] - band.gray for band in tried]
    square = np.concatenate(errors) ** 2
    alike, by_step = np.zeros(2 * n + 1), np.ones(2 * n + 1)
    grain = NO_GRAIN
    if len(step) > LAG:
        alike = square[step[:, 0] <= np.median(step)].mean(axis=0)
        by_step = np.maximum((square - alike).sum(axis=0), 0.0) / max(float(step.sum()), 1e-12)
        sigmas = [np.sqrt(alike + by_step * band.step + 1e-12) for band in tried]
        in_sigmas = [(error / sigma).T for error, sigma in zip(errors, sigmas, strict=True)]
        # The variance of the sum across the band, over that of independent errors.
        across = np.concatenate([each.sum(axis=0) for each in in_sigmas]) ** 2 / (2 * n + 1)
        long = [each for each in in_sigmas if each.shape[1] > LAG]
        if long:
            along, smooth = (
                float(np.mean([measure(each) for each in long]))
                for measure in (_grain_along, _smooth_grain)
            )
            grain = Grain(along, max(float(across.mean()), 1.0), smooth)
    result, variance = gray.copy(), np.zeros_like(gray)
    band = _band(gray, columns, course, n)
    result[band.rows, band.columns] = band.gray
    # Columns that do not show all of the band are not interpolated.
    variance[:] = square.mean(axis=0).max() if len(step) else 0.0
    variance[band.rows, band.columns] = alike + by_step * band.step
    return _Interpolated(result, variance, grain)


def _band(
    gray: Floats, columns: npt.NDArray[np.int64], course: npt.NDArray[np.int64], n: int
) -> _Band:
    """Interpolate linearly across a band along a course, in the columns that show all of it."""
    inside = (course - n - 1 >= 0) & (course + n + 1 < len(gray))
    columns, course = columns[inside, None], course[inside, None]
    before, after = gray[course - n - 1, columns], gray[course + n + 1, columns]
    offsets = np.arange(-n, n + 1)
    fraction = (offsets + n + 1) / (2 * n + 2)
    interpolated = np.asarray(before + fraction * (after - before))
    return _Band(course + offsets, columns, interpolated, np.asarray((after - before) ** 2))


@njit
def _explained(image: Floats, ground: Floats, smooth: Floats) -> tuple[float, float, float]:
    """Fit a gain; return it, and the median deviations from the ground and from a smooth one."""
    gain = median(image / np.maximum(ground, 1.0))
    return (
        gain,
        median(np.abs(image - gain * ground)),
        median(np.abs(image - gain * smooth)),
    )
