"""Fixed pattern noise: differences between pixels that are the same in every frame."""

from dataclasses import dataclass

import numpy as np

from vbaa_bench.sensor.quantise import Image


@dataclass(frozen=True)
class FixedPattern:
    """The `response` (h, w), near 1, and `offset` (h, w) [electrons], near 0, of each pixel."""

    response: Image
    offset: Image

    @classmethod
    def draw(
        cls, shape: tuple[int, int], prnu: float, dsnu: float, random: np.random.Generator
    ) -> "FixedPattern":
        """Draw a normal pattern with standard deviations `prnu` (relative) and `dsnu` [electrons].

        Responses are clipped at 0.
        """
        response = 1 + prnu * random.standard_normal(shape, dtype=np.float32)
        offset = dsnu * random.standard_normal(shape, dtype=np.float32)
        return cls(np.maximum(response, 0.0), offset)
