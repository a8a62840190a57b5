"""Colour filters on the photosites of an image sensor, and the reconstruction of their colours."""

from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np

from solver.instrument.arrays import Grey
from vbaa_bench.scene.image_sensor import BayerPattern
from vbaa_bench.sensor.quantise import Image

# The aliases that name a pattern by its upper left photosites; OpenCV's older constants, such as
# COLOR_BayerBG2BGR for rggb, name those from the second row and column on (opencv #19629).
_BILINEAR: Final[dict[BayerPattern, int]] = {
    "rggb": cv2.COLOR_BAYER_RGGB2BGR,
    "bggr": cv2.COLOR_BAYER_BGGR2BGR,
    "grbg": cv2.COLOR_BAYER_GRBG2BGR,
    "gbrg": cv2.COLOR_BAYER_GBRG2BGR,
}
_EDGE_AWARE: Final[dict[BayerPattern, int]] = {
    "rggb": cv2.COLOR_BAYER_RGGB2BGR_EA,
    "bggr": cv2.COLOR_BAYER_BGGR2BGR_EA,
    "grbg": cv2.COLOR_BAYER_GRBG2BGR_EA,
    "gbrg": cv2.COLOR_BAYER_GBRG2BGR_EA,
}


@dataclass(frozen=True)
class Mosaic:
    """A Bayer mosaic: signals of the channels at gray light, relative to the largest of them.

    `pattern` names the photosites of the upper left corner, row by row. With `white_balance`, the
    channels are scaled so that gray light is gray.
    """

    red: float
    green: float
    blue: float
    pattern: BayerPattern = "rggb"
    white_balance: bool = True
    edge_aware: bool = False

    def transmission(self, shape: tuple[int, ...]) -> Image:
        """Compute the relative signal (h, w) of each photosite at gray light."""
        signals = {"r": self.red, "g": self.green, "b": self.blue}
        image = np.empty(shape, np.float32)
        for place, channel in enumerate(self.pattern):
            image[place // 2 :: 2, place % 2 :: 2] = signals[channel]
        return image

    def colours(self, raw: Grey, black_level: float) -> Image:
        """Reconstruct blue, green and red (h, w, 3) [gray values] from the photosites (h, w).

        White balance scales what exceeds the black level. In the outermost rows and columns
        OpenCV repeats the next inner ones.
        """
        code = (_EDGE_AWARE if self.edge_aware else _BILINEAR)[self.pattern]
        colours = cv2.cvtColor(raw, code).astype(np.float32)
        if self.white_balance:
            signals = np.array([self.blue, self.green, self.red], np.float32)
            colours = (colours - black_level) / signals + black_level
        return np.asarray(colours, np.float32)


def to_gray(colours: Grey) -> Grey:
    """Weight blue, green and red (h, w, 3) to gray (h, w): 0.114, 0.587 and 0.299 (BT.601)."""
    return np.asarray(cv2.cvtColor(colours, cv2.COLOR_BGR2GRAY))
