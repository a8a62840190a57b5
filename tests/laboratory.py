"""A rig whose images are drawn in numpy: its calibration is exact, its beam lies as it is drawn."""

from dataclasses import replace

import numpy as np

from solver.antenna import Antenna
from solver.at_rest.landmarks import learn_landmarks
from solver.at_rest.rest_line import RestLine
from solver.at_rest.rest_state import RestState, learn_rest_state
from solver.calibrate import Calibration
from solver.centreline import Centreline, down_columns
from solver.centreline.extractor import learn_profile_fit
from solver.centreline.guide import Guide
from solver.centreline.noise import Noise
from solver.instrument.arrays import Grey
from solver.instrument.beam import Beam, circular_rigidity
from solver.instrument.rig import Rig
from tests.beam_images import HEIGHT, LENGTH, RADIUS, WIDTH, bent, guide
from tests.simulated import rig as reference

GUIDE = guide()
NOISE = Noise(1.0, 0.0)
CALIBRATION = Calibration(GUIDE.camera, 0.02)


class Blind:
    """Extractor that finds no beam. The ground is black: shading moves the middle fully."""

    shading = 1.0
    detector = None

    def __call__(self, _image: Grey) -> Centreline:
        return down_columns(np.empty((0, 2)), np.empty(0))


def rig() -> Rig:
    """The rig of the drawn images: `tests.beam_images`' beam before its telecentric camera."""
    beam = Beam(LENGTH, RADIUS, circular_rigidity(200e9, RADIUS))
    return replace(reference(), beam=beam, telecentric=True)


def at_rest(images: list[Grey], seen_by: Guide = GUIDE) -> RestState:
    """What images (height, width) of the beam at rest teach. Raises InputError."""
    return learn_rest_state(
        images, seen_by, learn_profile_fit, Calibration(seen_by.camera, 0.02), rig()
    )


def antenna_with(rest: RestLine) -> Antenna:
    """An antenna whose line at rest is `rest`, without landmarks in view."""
    even = np.full((HEIGHT, WIDTH), 50, np.uint8)
    marks = learn_landmarks([even], GUIDE.pixels(bent(0.0)[::100]), 10.0, NOISE)
    return Antenna(rig(), CALIBRATION, RestState(Blind(), rest, marks, NOISE, None, None, 0, ()))


def antenna(images: list[Grey]) -> Antenna:
    """The antenna that has learned from images (height, width) of the beam at rest."""
    return Antenna(rig(), CALIBRATION, at_rest(images))
