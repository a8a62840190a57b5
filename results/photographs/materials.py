"""Materials of beams and backgrounds, as they look in daylight."""

from typing import Final, Literal, NamedTuple

import numpy as np

from solver.instrument.arrays import Floats
from vbaa_bench.scene.paint import Paint

Colour = tuple[float, float, float]
Channel = Literal["gray", "r", "g", "b", "lab_b"]


class Material(NamedTuple):
    """Young's modulus [GPa], density [kg/m^3], colour (reflectances r, g, b) and paint of a beam.

    `grain` is the standard deviation of its reflectance over the mean: the grain of wood.
    """

    modulus_gpa: float
    density_kg_m3: float
    colour: Colour
    paint: Paint
    grain: float


# Three of five are wood. Moduli and densities are typical values of tables; colours are chosen.
MATERIALS: Final = {
    "beech": Material(13, 700, (0.62, 0.44, 0.28), "matt", 0.12),
    "spruce": Material(11, 450, (0.75, 0.60, 0.40), "matt", 0.15),
    "bamboo": Material(18, 700, (0.68, 0.56, 0.32), "gloss", 0.08),
    "carbon": Material(130, 1600, (0.03, 0.03, 0.033), "gloss", 0.02),
    "aluminium": Material(70, 2700, (0.55, 0.56, 0.58), "gloss", 0.03),
}


class Ground(NamedTuple):
    """Colour of a background, the contrast of its texture, and how much longer that is along x."""

    colour: Colour
    contrast: float
    ratio: float


GROUNDS: Final = {
    "wall": Ground((0.80, 0.78, 0.72), 0.03, 1),
    "dark table": Ground((0.16, 0.09, 0.05), 0.25, 15),
    "oak table": Ground((0.42, 0.29, 0.17), 0.20, 15),
    "gray cloth": Ground((0.22, 0.22, 0.24), 0.10, 1),
    "blue card": Ground((0.10, 0.17, 0.38), 0.04, 1),
    "green mat": Ground((0.06, 0.22, 0.14), 0.08, 1),
}
# Least difference of beam and background, as a fraction of full scale, in the channel that is read.
# Chosen: below, a person would take another background.
LEAST_CONTRAST: Final = 0.2


def best_channel(beam: Colour, ground: Colour) -> tuple[Channel, float]:
    """Choose the channel with the largest contrast of two colours; return it and the contrast.

    The light on beam and background is assumed to be the same. The contrast is the difference of
    the encoded values over full scale.
    """
    first, second = (_encoded(colour) for colour in (beam, ground))
    channels: dict[Channel, float] = {
        "gray": float((first - second) @ [0.299, 0.587, 0.114]),
        "r": float((first - second)[0]),
        "b": float((first - second)[2]),
        # Blue to yellow: about the difference of the mean of red and green, and blue.
        "lab_b": float((first - second) @ [0.35, 0.35, -0.7]),
    }
    channel = max(channels, key=lambda name: abs(channels[name]))
    # Gray has the least noise: another channel must be better by far.
    if abs(channels["gray"]) > 0.7 * abs(channels[channel]):
        channel = "gray"
    return channel, abs(channels[channel])


def _encoded(colour: Colour) -> Floats:
    """Approximate the curve of sRGB."""
    return np.array(colour) ** (1 / 2.2)
