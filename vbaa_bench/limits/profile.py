"""Fisher information of the gray profile across a beam, for each pixel of its length.

Across the beam the radiance is that of the lit surface within the half width and that of the
background outside. The image is its convolution with a pixel's square and the point spread, seen
along the normal. Noise of pixels is independent, and normal with a variance that follows from the
mean. Then the information on parameters a and b is the sum over pixels of

    (dI/da) (dI/db) / variance

(Kay 1993, eq. 3.31, without the part of the variance's own change, which is smaller by the number
of electrons). A sum over pixels at random places relative to the beam is the integral over the
normal: there is one pixel per unit of area.

The background is that of the ground's mean reflectance, and the structure of a ground is known to
the last detail: the limit is that of exact images of the ground without the beam. With n noisy
ones, the variance of a pixel beside the beam is larger by the factor 1 + 1 / n.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final, NamedTuple

import numpy as np

from solver.instrument.arrays import Floats
from solver.instrument.units import PERCENT
from vbaa_bench.scene.image_sensor import SensorSpec
from vbaa_bench.sensor.ideal import Ideal
from vbaa_bench.sensor.sensor import Sensor

# Step [px] of the grid across the beam. Measured: with half of it, the information of a beam of
# 0.3 to 8 px changes by less than 1e-3.
STEP: Final = 0.01
# Relative change of the half width for its derivative.
_WIDER: Final = 1e-3

SHIFT, BRIGHTNESS, BACKGROUND, WIDTH = range(4)
# Maps the mean radiances of pixels to the variances of their noise [radiance^2].
Variance = Callable[[Floats], Floats]


@dataclass(frozen=True)
class PixelNoise:
    """Noise of a pixel over exposures, and over the pixels of one sensor.

    Shot noise, read noise and rounding are those of `sensor`. Its fixed pattern is unknown where
    the beam is imaged for the first time, so `response` (relative) and `offset` [electrons], its
    standard deviations over the pixels, count as noise. Colours that are reconstructed between the
    photosites of a mosaic, compression and defective pixels are neglected: they take information
    away.
    """

    sensor: Sensor | Ideal
    response: float = 0.0
    offset: float = 0.0

    @classmethod
    def of(cls, spec: SensorSpec, sensor: Sensor | Ideal) -> "PixelNoise":
        """Describe the noise of a scene's sensor."""
        return cls(sensor, spec.prnu_pct * PERCENT, spec.dsnu_e)

    def variance(self, radiance: Floats) -> Floats:
        """Compute the variance [radiance^2] of pixels; it is infinite where they are saturated."""
        variance = self.sensor.noise_sigma(radiance) ** 2 + (self.response * radiance) ** 2
        if isinstance(self.sensor, Sensor):
            variance += (self.offset / self.sensor.electrons_per_radiance) ** 2
        return np.where(radiance < self.sensor.largest_radiance, variance, np.inf)


@dataclass(frozen=True)
class SurfaceProfile:
    """Radiance across the beam in one place, and its direction, width and blur in the image.

    `radiance` (k,) is that of the beam at even offsets from one side to the other, at the middles
    of k equal parts of the width, and `background` that beside it. `half_width` is in [px],
    `normal` (2,) is the unit vector across the beam in the image, and `point_spread` [px] is the
    sigma of the lens. `diffuse` (k,) is the part of the radiance that the paint scatters.
    """

    radiance: Floats
    background: float
    half_width: float
    normal: Floats
    point_spread: float = 0.0
    diffuse: Floats = field(default_factory=lambda: np.zeros(1))


class GrayProfile(NamedTuple):
    """Mean radiance (n,) in pixels whose centres have `offset` (n,) [px] from the beam's centre.

    `cover` (n,) is the fraction of a pixel that the beam covers. `slopes` (4, n) are derivatives of
    `mean`: by a shift of the beam [1/px], by the relative brightness of beam and of background, and
    by the relative width.
    """

    offset: Floats
    mean: Floats
    cover: Floats
    slopes: Floats


def gray_profile(surface: SurfaceProfile) -> GrayProfile:
    """Compute the mean radiance of pixels across the beam, and its derivatives."""
    kernel = _pixel_kernel(surface.normal, surface.point_spread)
    reach = surface.half_width * (1 + _WIDER) + max(len(kernel) * STEP / 2, 2.0) + 3 * STEP
    reach += 3 * surface.point_spread
    count = int(np.ceil(reach / STEP))
    offset: Floats = STEP * np.arange(-count, count + 1, dtype=np.float64)

    def images(half_width: float) -> tuple[Floats, Floats]:
        """Convolve the beam's radiance and its cover."""
        beam, cover = _cell_means(surface.radiance, half_width, offset)
        return np.convolve(beam, kernel, mode="same"), np.convolve(cover, kernel, mode="same")

    def total(beam: Floats, cover: Floats) -> Floats:
        # Beyond the grid there is background.
        return beam + surface.background * (1 - cover)

    beam, cover = images(surface.half_width)
    narrow, wide = (total(*images(surface.half_width * (1 + sign * _WIDER))) for sign in (-1, 1))
    mean, ground = total(beam, cover), surface.background * (1 - cover)
    slopes = [-np.gradient(mean, STEP), beam, ground, (wide - narrow) / (2 * _WIDER)]
    return GrayProfile(offset, mean, cover, np.array(slopes))


def information(surface: SurfaceProfile, variance: Variance) -> Floats:
    """Compute the information (4, 4) of one pixel of the beam's length.

    The parameters are those of `GrayProfile.slopes`.
    """
    profile = gray_profile(surface)
    inside = inside_profile(surface, profile.offset)
    weighted = profile.slopes * (inside / variance(profile.mean))
    return np.asarray(weighted @ profile.slopes.T * STEP)


def edge_information(
    dark: float,
    light: Floats,
    normal: Floats,
    point_spread: float,
    variance: Variance,
) -> Floats:
    """Compute the information (n,) [1/px^2] of a pixel's length of an edge on its position.

    `dark` and `light` (n,) are the radiances beside it, `normal` (2,) is across it.
    """
    # The side of a wide strip of constant radiance.
    edge = gray_profile(SurfaceProfile(np.ones(3), 0.0, 20.0, normal, point_spread))
    side = edge.offset > 0
    contrast = (light - dark)[:, None]
    slopes = edge.slopes[SHIFT][side] * contrast
    return np.asarray((slopes**2 / variance(dark + edge.mean[side] * contrast)).sum(axis=1) * STEP)


def inside_profile(surface: SurfaceProfile, offset: Floats) -> Floats:
    """Return which fraction (n,) of the cells of a grid at `offset` (n,) [px] is near the beam.

    Far from the beam only the background remains; its brightness is not part of its profile.
    """
    end = surface.half_width + 2.0 + 3 * surface.point_spread
    return np.clip((end - np.abs(offset)) / STEP + 0.5, 0.0, 1.0)


def unit_cells(surface: SurfaceProfile, offset: Floats) -> Floats:
    """Compute the image (k, n) of each part of the width, with radiance 1, at `offset` (n,) [px].

    Their sum, each times its radiance, is the image of the beam.
    """
    kernel = _pixel_kernel(surface.normal, surface.point_spread)
    parts = np.eye(len(surface.radiance))
    images = (_cell_means(part, surface.half_width, offset)[0] for part in parts)
    return np.array([np.convolve(image, kernel, mode="same") for image in images])


def _cell_means(radiance: Floats, half_width: float, offset: Floats) -> tuple[Floats, Floats]:
    """Average the beam's radiance and cover (n,) over the cells of the grid about `offset` (n,)."""
    sides = np.linspace(-half_width, half_width, len(radiance) + 1)
    integral = np.concatenate([[0.0], np.cumsum(radiance)]) * (sides[1] - sides[0])
    edges = np.append(offset - STEP / 2, offset[-1] + STEP / 2)
    beam = np.diff(np.interp(edges, sides, integral)) / STEP
    cover = np.diff(np.clip(edges, -half_width, half_width)) / STEP
    return beam, cover


def _pixel_kernel(normal: Floats, point_spread: float) -> Floats:
    """Project a pixel's square, and a Gaussian point spread, on the normal; the sum is 1."""
    kernel = np.ones(1)
    for side in np.abs(normal):
        half = max(side / 2, 0.0)
        count = int(np.ceil(half / STEP + 0.5))
        edges = STEP * (np.arange(-count, count + 2) - 0.5)
        box = np.diff(np.clip(edges, -half, half))
        if box.sum() > 0:
            kernel = np.convolve(kernel, box / box.sum())
    if point_spread > 0:
        count = int(np.ceil(5 * point_spread / STEP))
        gauss = np.exp(-0.5 * (STEP * np.arange(-count, count + 1) / point_spread) ** 2)
        kernel = np.convolve(kernel, gauss / gauss.sum())
    return np.asarray(kernel)
