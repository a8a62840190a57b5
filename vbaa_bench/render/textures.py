"""Reflectances that change from place to place on a flat sheet. Lengths are [m]."""

import numpy as np

from solver.instrument.arrays import Floats
from vbaa_bench.render.materials import Texture

# A texel is this share of the correlation length.
TEXEL = 1 / 8
LARGEST = 2048


def graded(places: Floats, near: float, far: float, azimuth: float, length: float) -> Texture:
    """Reflectance from `near` to `far` over `length` about the origin of `places` (n, 2), evenly
    along `azimuth` [rad]; constant beyond."""
    share = 0.5 + places @ np.array([np.cos(azimuth), np.sin(azimuth)]) / length
    # Between the middles of two texels a bilinear texture is a straight line.
    uv = np.column_stack([0.25 + 0.5 * share, np.full(len(places), 0.5)])
    return Texture(np.array([[near, far]]), uv)


def grown(
    places: Floats,
    mean: float,
    contrast: float,
    correlation: tuple[float, float],
    extent: float,
    random: np.random.Generator,
) -> Texture:
    """A random texture that lies at `places` (n, 2) and repeats itself after `extent`.

    The logarithm of reflectance is a Gaussian field whose correlation at a distance (x, y) is
    exp(-r), r^2 = (x/a)^2 + (y/b)^2, with `correlation` (a, b): it has grain of every size up to
    those, as grown and poured stuff has. Reflectance has the given `mean` and, as `contrast`,
    standard deviation over mean, but is cut off at 1.
    """
    texels = np.array(correlation) * TEXEL
    # The finest textures repeat themselves sooner.
    columns, rows = np.minimum(np.ceil(extent / texels), LARGEST).astype(int)
    # White noise takes the square root of the spectrum of exp(-r), (1 + (2 pi f)^2)^(-3/2).
    fx, fy = np.fft.rfftfreq(columns, texels[0]), np.fft.fftfreq(rows, texels[1])
    a, b = correlation
    squared = (2 * np.pi) ** 2 * ((a * fx[None, :]) ** 2 + (b * fy[:, None]) ** 2)
    amplitude = (1 + squared) ** -0.75
    noise = np.fft.rfft2(random.standard_normal((rows, columns)))
    field = np.fft.irfft2(noise * amplitude, s=(rows, columns))
    field = (field - field.mean()) / field.std()
    spread = np.sqrt(np.log1p(contrast**2))
    image = mean * np.exp(spread * field - spread**2 / 2)
    return Texture(np.minimum(image, 1.0), places / (texels * [columns, rows]), repeated=True)
