"""Textures: reflectances that vary over a flat sheet. Lengths are [m]."""

import numpy as np

from solver.instrument.arrays import Floats
from vbaa_bench.render.materials import Texture

# Size of a texel, as a fraction of the correlation length.
TEXEL = 1 / 8
MAX_TEXELS = 2048


def gradient_texture(
    places: Floats, near: float, far: float, azimuth: float, length: float
) -> Texture:
    """Create a linear gradient of reflectance from `near` to `far` along `azimuth` [rad].

    It extends over `length`, centred on the origin of `places` (n, 2), and is constant beyond.
    """
    fraction = 0.5 + places @ np.array([np.cos(azimuth), np.sin(azimuth)]) / length
    # A bilinear texture is linear between the centres of two texels.
    uv = np.column_stack([0.25 + 0.5 * fraction, np.full(len(places), 0.5)])
    return Texture(np.array([[near, far]]), uv)


def random_texture(
    places: Floats,
    mean: float,
    contrast: float,
    correlation: tuple[float, float],
    extent: float,
    random: np.random.Generator,
) -> Texture:
    """Create a random texture at `places` (n, 2) that repeats after `extent`.

    The logarithm of reflectance is a Gaussian field whose correlation at a distance (x, y) is
    exp(-r), r^2 = (x/a)^2 + (y/b)^2, with `correlation` (a, b). It has grain of every size up to
    these lengths, like natural and cast materials. Reflectance has the given `mean`; `contrast` is
    its standard deviation over its mean. It is clipped at 1.
    """
    texels = np.array(correlation) * TEXEL
    # The size is limited to MAX_TEXELS texels: the finest textures repeat sooner.
    columns, rows = np.minimum(np.ceil(extent / texels), MAX_TEXELS).astype(int)
    # White noise is multiplied by the square root of the spectrum of exp(-r), which is
    # (1 + (2 pi f)^2)^(-3/2).
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
