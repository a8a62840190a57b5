"""A real monochrome image sensor: radiance -> photons -> electrons -> gray values.

The linear model of EMVA Standard 1288, release 4.0 (2021), section 2, in its order: photons,
quantum efficiency, shot noise of light and dark current, non-uniformity of the pixels, full
well, read noise, gain and black level, quantisation. Gamma, which is not in the standard, is
applied before quantisation.

A renderer draws new samples for every frame, so its images are noisy themselves. The sensor adds
only the noise that the radiance does not contain already.
"""

from dataclasses import dataclass

import numpy as np

from solver.instrument.arrays import Floats, Grey
from vbaa_bench.sensor.fixed_pattern import FixedPattern
from vbaa_bench.sensor.quantise import Image, full_scale, quantise
from vbaa_bench.sensor.shot_noise import poisson


@dataclass(frozen=True)
class Sensor:
    """The parameters of a real image sensor.

    `exposure` [photons per unit of radiance]; `full_well`, `read_noise` [electrons]. `dark_signal`
    [electrons] is the mean of a dark frame. `gain` is in [electrons per gray value]; without it the
    full well is full scale. `black_level` [gray values] is added before gamma: gray over full scale
    is the linear value to the power of 1 / `gamma`.
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
        mean = self._mean_electrons(radiance)
        shot: Image = mean
        read: Image | float = self.read_noise
        if render_variance is not None:
            missing = mean - render_variance.astype(np.float32) * self._response**2
            shot = np.maximum(missing, 0.0)
            read = np.sqrt(np.maximum(self.read_noise**2 + np.minimum(missing, 0.0), 0.0))
        electrons = mean - shot + poisson(shot, random)
        if self.pattern is not None:
            light = electrons - self.dark_signal
            electrons = electrons + (self.pattern.response - 1) * light + self.pattern.offset
        electrons = np.minimum(electrons, self.full_well)
        electrons += read * random.standard_normal(mean.shape, dtype=np.float32)
        return quantise(self._encoded(electrons), self.bits)

    def noise_sigma(self, radiance: Floats) -> Floats:
        """Compute the standard deviation (h, w) in radiance: shot noise, read noise, rounding."""
        mean = self._mean_electrons(radiance)
        variance = mean + self.read_noise**2 + self._step(mean) ** 2 / 12
        return np.asarray(np.sqrt(variance) / self._response, dtype=np.float64)

    @property
    def _response(self) -> float:
        """Electrons per unit of radiance."""
        return self.exposure * self.quantum_efficiency

    @property
    def _gain(self) -> float:
        """Electrons per gray value, before gamma."""
        return self.gain or self.full_well / (full_scale(self.bits) - self.black_level)

    def _mean_electrons(self, radiance: Floats) -> Image:
        """Compute the mean electrons of light plus dark current, together one Poisson process."""
        light = np.maximum(radiance.astype(np.float32), 0.0) * self._response
        return np.asarray(light + self.dark_signal, dtype=np.float32)

    def _linear(self, electrons: Image) -> Image:
        gray = electrons / self._gain + self.black_level
        return np.asarray(gray / full_scale(self.bits), dtype=np.float32)

    def _encoded(self, electrons: Image) -> Image:
        linear = self._linear(electrons)
        if self.gamma == 1:
            return linear
        return np.asarray(np.clip(linear, 0.0, 1.0) ** (1 / self.gamma))

    def _step(self, electrons: Image) -> Image | float:
        """Compute the electrons per gray value, after gamma."""
        if self.gamma == 1:
            return self._gain
        encoded = self._encoded(electrons)
        return np.asarray(self._gain * self.gamma * encoded ** (self.gamma - 1), dtype=np.float32)
