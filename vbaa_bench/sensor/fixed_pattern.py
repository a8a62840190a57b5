"""Fixed pattern noise: no two pixels are alike, and each is the same in every frame."""

from dataclasses import dataclass

import numpy as np

from vbaa_bench.sensor.quantise import Image


@dataclass(frozen=True)
class FixedPattern:
    """Each pixel's `response` (h, w), about 1, and its `offset` (h, w) [electrons], about 0."""

    response: Image
    offset: Image

    @classmethod
    def draw(
        cls, shape: tuple[int, int], prnu: float, dsnu: float, random: np.random.Generator
    ) -> "FixedPattern":
        """Normal over the pixels: standard deviations `prnu`, a share, and `dsnu` [electrons].

        No pixel's response is negative.
        """
        response = 1 + prnu * random.standard_normal(shape, dtype=np.float32)
        offset = dsnu * random.standard_normal(shape, dtype=np.float32)
        return cls(np.maximum(response, 0.0), offset)
