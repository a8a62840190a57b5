"""A real image sensor: radiance -> photons -> electrons -> gray values.

The linear model of EMVA Standard 1288, release 4.0 (2021), section 2, in its order: photons,
quantum efficiency, shot noise of light and dark current, non-uniformity of the pixels, full
well, read noise, gain and black level, quantisation. Not in the standard: gamma, which is applied
before quantisation, a Bayer mosaic and compression.

The photosites of a colour sensor are quantised without gamma. Their colours are reconstructed and
balanced, gamma is applied, and the quantised colours are converted to gray.

A renderer draws new samples for every frame, so its images are noisy themselves. The sensor adds
only the noise that the radiance does not contain already.
"""

from dataclasses import dataclass

import numpy as np

from solver.instrument.arrays import Floats, Grey
from vbaa_bench.sensor.compression import jpeg
from vbaa_bench.sensor.fixed_pattern import FixedPattern
from vbaa_bench.sensor.mosaic import Mosaic, to_gray
from vbaa_bench.sensor.quantise import Image, full_scale, quantise
from vbaa_bench.sensor.shot_noise import poisson


@dataclass(frozen=True)
class Sensor:
    """The parameters of a real image sensor.

    `exposure` [photons per unit of radiance]; `full_well`, `read_noise` [electrons]. `dark_signal`
    [electrons] is the mean of a dark frame. `gain` is in [electrons per gray value]; without it the
    full well is full scale. `black_level` [gray values] is added before gamma: gray over full scale
    is the linear value to the power of 1 / `gamma`. With a `mosaic`, exposure and `noise_sigma` are
    those of its most sensitive channel. Images of 8 bits are compressed if `jpeg_quality` is given.
    """

    exposure: float
    full_well: float
    read_noise: float
    quantum_efficiency: float = 1.0
    dark_signal: float = 0.0
    bits: int = 8
    gain: float | None = None
    black_level: float = 0.0
    gamma: float = 1.0
    pattern: FixedPattern | None = None
    mosaic: Mosaic | None = None
    jpeg_quality: int | None = None

    def expose(
        self,
        radiance: Floats,
        random: np.random.Generator,
        render_variance: Floats | None = None,
    ) -> Grey:
        """Expose one frame (h, w) to a radiance image (h, w): uint8 for 8 bits, else uint16.

        `render_variance` (h, w) [radiance^2] is the variance of the radiance from frame to frame.
        It is subtracted from the shot noise and, if it exceeds that, from the read noise.
        """
        gray = self._gray(self._electrons(radiance, random, render_variance))
        return gray if self.jpeg_quality is None else jpeg(gray, self.jpeg_quality)

    def photosites(
        self,
        radiance: Floats,
        random: np.random.Generator,
        render_variance: Floats | None = None,
    ) -> Grey:
        """Expose one frame as in `expose`; return the gray values of the photosites, linear."""
        return quantise(self._linear(self._electrons(radiance, random, render_variance)), self.bits)

    def _electrons(
        self, radiance: Floats, random: np.random.Generator, render_variance: Floats | None
    ) -> Image:
        """Draw the electrons (h, w) that are read out."""
        if self.mosaic is not None:
            transmission = self.mosaic.transmission(radiance.shape)
            radiance = transmission * radiance
            if render_variance is not None:
                render_variance = transmission**2 * render_variance
        mean = self._mean_electrons(radiance)
        if self.pattern is not None:
            mean = mean + self.pattern.hot_signal
        shot: Image = mean
        read: Image | float = self.read_noise
        if render_variance is not None:
            missing = mean - render_variance.astype(np.float32) * self.electrons_per_radiance**2
            shot = np.maximum(missing, 0.0)
            read = np.sqrt(np.maximum(self.read_noise**2 + np.minimum(missing, 0.0), 0.0))
        electrons = mean - shot + poisson(shot, random)
        if self.pattern is not None:
            light = electrons - self.dark_signal - self.pattern.hot_signal
            electrons = electrons + (self.pattern.response - 1) * light + self.pattern.offset
        electrons = np.minimum(electrons, self.full_well)
        electrons += read * random.standard_normal(mean.shape, dtype=np.float32)
        return np.asarray(electrons)

    def _gray(self, electrons: Image) -> Grey:
        """Convert electrons to gray values, those of a mosaic by way of its colours."""
        if self.mosaic is None:
            return quantise(self._encoded(self._linear(electrons)), self.bits)
        raw = quantise(self._linear(electrons), self.bits)
        colours = self.mosaic.colours(raw, self.black_level) / np.float32(full_scale(self.bits))
        return to_gray(quantise(self._encoded(colours), self.bits))

    def noise_sigma(self, radiance: Floats) -> Floats:
        """Compute the standard deviation (h, w) in radiance: shot noise, read noise, rounding."""
        mean = self._mean_electrons(radiance)
        variance = mean + self.read_noise**2 + self._step(mean) ** 2 / 12
        return np.asarray(np.sqrt(variance) / self.electrons_per_radiance, dtype=np.float64)

    def radiance(self, gray: Grey) -> Floats:
        """Convert gray values (h, w) to the radiance whose mean they are; not with a mosaic."""
        linear = (gray / full_scale(self.bits)) ** self.gamma * full_scale(self.bits)
        electrons = (linear - self.black_level) * self._gain
        return np.asarray((electrons - self.dark_signal) / self.electrons_per_radiance)

    @property
    def largest_radiance(self) -> float:
        """Radiance from which on a pixel is saturated, in its well or at full scale."""
        full_scale_e = self._gain * (full_scale(self.bits) - self.black_level)
        return (min(self.full_well, full_scale_e) - self.dark_signal) / self.electrons_per_radiance

    @property
    def electrons_per_radiance(self) -> float:
        """Electrons per unit of radiance."""
        return self.exposure * self.quantum_efficiency

    @property
    def _gain(self) -> float:
        """Electrons per gray value, before gamma."""
        return self.gain or self.full_well / (full_scale(self.bits) - self.black_level)

    def _mean_electrons(self, radiance: Floats) -> Image:
        """Compute the mean electrons of light plus dark current, together one Poisson process."""
        light = np.maximum(radiance.astype(np.float32), 0.0) * self.electrons_per_radiance
        return np.asarray(light + self.dark_signal, dtype=np.float32)

    def _linear(self, electrons: Image) -> Image:
        gray = electrons / self._gain + self.black_level
        return np.asarray(gray / full_scale(self.bits), dtype=np.float32)

    def _encoded(self, linear: Image) -> Image:
        if self.gamma == 1:
            return linear
        return np.asarray(np.clip(linear, 0.0, 1.0) ** (1 / self.gamma))

    def _step(self, electrons: Image) -> Image | float:
        """Compute the electrons per gray value, after gamma."""
        if self.gamma == 1:
            return self._gain
        encoded = self._encoded(self._linear(electrons))
        return np.asarray(self._gain * self.gamma * encoded ** (self.gamma - 1), dtype=np.float32)
