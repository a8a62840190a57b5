"""Fixed pattern noise: differences between pixels that are the same in every frame."""

from dataclasses import dataclass

import numpy as np

from vbaa_bench.sensor.quantise import Image


@dataclass(frozen=True)
class FixedPattern:
    """Deviations of each pixel from the mean one.

    `response` (h, w) is near 1, and 0 for a dead pixel; `offset` (h, w) [electrons] is near 0.
    `hot_signal` (h, w) [electrons] is the mean dark signal that hot pixels have in addition.
    """

    response: Image
    offset: Image
    hot_signal: Image | float = 0.0

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

    def with_defects(
        self, hot: float, hot_signal: float, dead: float, random: np.random.Generator
    ) -> "FixedPattern":
        """Draw hot and dead pixels, with the probabilities `hot` and `dead` for each pixel.

        The additional dark signal of hot pixels has an exponential distribution with the mean
        `hot_signal` [electrons]: in real sensors a few are far brighter than most.
        """
        shape = self.response.shape
        is_hot, is_dead = (random.random(shape) < chance for chance in (hot, dead))
        signal = random.exponential(hot_signal, shape) * is_hot
        response = np.where(is_dead, np.float32(0), self.response)
        return FixedPattern(response, self.offset, signal.astype(np.float32))
