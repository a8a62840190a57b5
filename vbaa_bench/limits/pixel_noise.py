"""Variance of a pixel's radiance by the noise of the image sensor, for information limits."""

from dataclasses import dataclass

import numpy as np

from solver.instrument.arrays import Floats
from solver.instrument.units import PERCENT
from vbaa_bench.scene.image_sensor import SensorSpec
from vbaa_bench.sensor.ideal import Ideal
from vbaa_bench.sensor.sensor import Sensor


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
