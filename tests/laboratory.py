"""A rig whose images are drawn in numpy: its calibration is exact, its beam lies as it is drawn."""

from dataclasses import replace

from solver.antenna import Antenna
from solver.at_rest.learn import AtRest, learn_at_rest
from solver.calibrate import Calibration
from solver.centreline.extractor import learn_beam
from solver.centreline.guide import Guide
from solver.instrument.arrays import Grey
from solver.instrument.beam import Beam, circular_rigidity
from solver.instrument.rig import Rig
from tests.beam_images import LENGTH, RADIUS, guide
from tests.simulated import rig as reference

GUIDE = guide()
CALIBRATION = Calibration(GUIDE.camera, 0.02)


def rig() -> Rig:
    """The rig of the drawn images: `tests.beam_images`' beam before its telecentric camera."""
    beam = Beam(LENGTH, RADIUS, circular_rigidity(200e9, RADIUS))
    return replace(reference(), beam=beam, telecentric=True)


def at_rest(images: list[Grey], seen_by: Guide = GUIDE) -> AtRest:
    """What images (height, width) of the beam at rest teach. Raises InputError."""
    return learn_at_rest(images, seen_by, learn_beam, Calibration(seen_by.camera, 0.02), rig())


def antenna(images: list[Grey]) -> Antenna:
    """The antenna that has learned from images (height, width) of the beam at rest."""
    return Antenna(rig(), CALIBRATION, at_rest(images))
