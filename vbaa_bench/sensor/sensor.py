"""A monochrome image sensor: shot noise, read noise, full well, 8-bit gray."""

from dataclasses import dataclass

import numpy as np

from solver.instrument.arrays import Floats, Grey


@dataclass(frozen=True)
class Sensor:
    """`exposure` [electrons per unit of radiance], `full_well` and `read_noise` [electrons].

    The full well is full scale: gray 255. Gray is linear in electrons.
    """

    exposure: float
    full_well: float
    read_noise: float

    def expose(self, radiance: Floats, random: np.random.Generator) -> Grey:
        """One 8-bit frame (height, width) of a radiance image of the same shape."""
        mean = np.maximum(radiance, 0.0) * self.exposure
        electrons = random.poisson(mean) + random.normal(0.0, self.read_noise, mean.shape)
        gray = np.rint(np.clip(electrons / self.full_well, 0.0, 1.0) * 255)
        return gray.astype(np.uint8)


def exposure_for(peak_radiance: float, full_well: float, peak_share: float) -> float:
    """Electrons per unit of radiance that put `peak_radiance` at `peak_share` of the full well."""
    if not peak_radiance > 0:
        raise ValueError(f"the beam's peak radiance is {peak_radiance}, allowed is > 0")
    return peak_share * full_well / peak_radiance
