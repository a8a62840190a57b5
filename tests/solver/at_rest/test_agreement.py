"""Motion between rest images against noise that is taken for it."""

from functools import cache
from itertools import cycle

import numpy as np
import pytest

from solver.at_rest.agreement import moved
from solver.at_rest.rest_state import learn_rest_state
from solver.centreline import Centreline, down_columns
from solver.instrument.arrays import Floats, Grey
from solver.instrument.errors import InputError
from tests.beam_images import HEIGHT, METRES_PER_PIXEL, WIDTH, Look, Sensor, bent, drawn
from tests.laboratory import CALIBRATION, GUIDE, rig

SENSOR = Sensor(full_well=4000)
# A black beam, out of focus.
DARK = Look(beam=0.02, spread_px=1.5)
PATH = GUIDE.pixels(bent(0.0)[300::40])
COLUMNS = np.unique(np.rint(PATH[:, 0]))


@cache
def still(beam_px: float = 0.0, ground_px: int = 0) -> Floats:
    """Light of a beam before squares of 8 px, of beam and ground moved across the beam."""
    v, u = np.mgrid[:HEIGHT, :WIDTH]
    squares = np.where((u // 8 + (v + ground_px) // 8) % 2, 0.05, 0.3)
    return drawn(GUIDE, bent(0.0, offset=beam_px * METRES_PER_PIXEL), DARK, squares)


def line(off_px: float = 0.0) -> Centreline:
    """The beam at rest as an extractor finds it, off its place."""
    centres = np.interp(COLUMNS, PATH[:, 0], PATH[:, 1]) + off_px
    return down_columns(np.column_stack([COLUMNS, centres]), np.full(len(COLUMNS), 0.02))


def images(random: np.random.Generator, *light: Floats) -> list[Grey]:
    return [SENSOR(one, random) for one in light]


def test_noise_and_flicker_are_no_motion(random: np.random.Generator) -> None:
    lines = [line(off) for off in (0.3, -0.3, 0.3, -0.3)]
    assert not moved(images(random, *[still()] * 4), lines, GUIDE.radius_px)
    flickering = images(random, *(level * still() for level in (1.0, 0.97, 1.02, 0.98)))
    assert not moved(flickering, lines, GUIDE.radius_px)


@pytest.mark.parametrize("off_px", [{"beam_px": 0.7}, {"beam_px": 0.7, "ground_px": 1}])
def test_motion_of_the_beam_or_of_everything_is_found(
    random: np.random.Generator, off_px: dict[str, float]
) -> None:
    taken = images(random, *[still()] * 3, still(**off_px))
    assert moved(taken, [line()] * 4, GUIDE.radius_px)


class Apart:
    """An extractor that finds the beam 0.66 px apart in consecutive images."""

    shading, detector = 1.0, None

    def __init__(self) -> None:
        self._off = cycle([0.33, -0.33])

    def __call__(self, _image: Grey, /) -> Centreline:
        return line(next(self._off))


def test_still_images_that_show_the_beam_apart_are_refused_for_their_contrast(
    random: np.random.Generator,
) -> None:
    taken = images(random, *[still()] * 4)
    with pytest.raises(InputError, match=r"contrast of the beam is too low: .* 0\.33 px apart"):
        learn_rest_state(taken, GUIDE, lambda _images, _guide: Apart(), CALIBRATION, rig())
