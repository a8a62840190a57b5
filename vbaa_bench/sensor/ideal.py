"""An ideal image sensor, which is none: gray values are radiance."""

from dataclasses import dataclass

import numpy as np

from solver.instrument.arrays import Floats, Grey
from vbaa_bench.sensor.quantise import full_scale, quantise


@dataclass(frozen=True)
class Ideal:
    """`exposure` [full scales per unit of radiance]; adds nothing but rounding to `bits`."""

    exposure: float
    bits: int = 8

    def expose(
        self,
        radiance: Floats,
        random: np.random.Generator,  # noqa: ARG002 - what a real sensor takes
        render_variance: Floats | None = None,  # noqa: ARG002
    ) -> Grey:
        """One frame (h, w) of a radiance image (h, w), the same for every `random`."""
        return quantise(radiance * self.exposure, self.bits)

    def noise_sigma(self, radiance: Floats) -> Floats:
        """That of rounding, in radiance (h, w): a uniform error of one gray value."""
        step = 1 / (full_scale(self.bits) * self.exposure)
        return np.full(radiance.shape, step / np.sqrt(12))
