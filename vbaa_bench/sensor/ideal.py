"""An ideal image sensor: gray values are proportional to radiance."""

from dataclasses import dataclass

import numpy as np

from solver.instrument.arrays import Floats, Grey
from vbaa_bench.sensor.quantise import full_scale, quantise


@dataclass(frozen=True)
class Ideal:
    """A noise-free sensor of `exposure` [full scales per unit of radiance], rounding to `bits`."""

    exposure: float
    bits: int = 8

    def expose(
        self,
        radiance: Floats,
        random: np.random.Generator,  # noqa: ARG002 - a real sensor needs it
        render_variance: Floats | None = None,  # noqa: ARG002
    ) -> Grey:
        """Expose one frame (h, w) to a radiance image (h, w); `random` is not used."""
        return quantise(radiance * self.exposure, self.bits)

    def radiance(self, gray: Grey) -> Floats:
        """Convert gray values (h, w) to the radiance whose mean they are."""
        return np.asarray(gray / (full_scale(self.bits) * self.exposure))

    @property
    def largest_radiance(self) -> float:
        """Radiance from which on a pixel is saturated."""
        return 1 / self.exposure

    def noise_sigma(self, radiance: Floats) -> Floats:
        """Compute the rounding noise (h, w) in radiance: error uniform over one gray value."""
        step = 1 / (full_scale(self.bits) * self.exposure)
        return np.full(radiance.shape, step / np.sqrt(12))
