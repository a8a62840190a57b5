"""Every way of measuring the beam learns from rest images; the paper's knows one kind of beam."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from solver.centreline.area_weighted import learn_area_weighted
from solver.centreline.extractors import EXTRACTORS
from solver.instrument.arrays import Floats, Grey
from solver.instrument.errors import InputError
from solver.planes.shading import SHADING
from tests.beam_images import HEIGHT, WIDTH, Look, Sensor, bent, cover, distances, drawn, guide
from tests.draws import generator

PAPER = "area_weighted"


def at_rest(look: Look, roll: float = 0.0) -> list[Grey]:
    light, random = drawn(guide(roll), bent(0.0), look), generator(__name__, 1)
    return [Sensor()(light, random) for _ in range(2)]


@pytest.mark.parametrize("name", EXTRACTORS)
def test_each_finds_the_beam_where_it_lies(name: str) -> None:
    images = at_rest(Look())
    line = EXTRACTORS[name](images, guide())(images[0])
    assert len(line.points) > 200
    assert np.median(np.abs(distances(line.points, guide().pixels(bent(0.0))))) < 0.1


def test_the_paper_sees_no_other_than_a_bright_beam_from_left_to_right() -> None:
    with pytest.raises(InputError, match="no bright beam that runs from left to right"):
        learn_area_weighted(at_rest(Look(), np.pi / 2), guide(np.pi / 2))
    even = [np.full((40, 60), 20, np.uint8)]
    with pytest.raises(InputError, match="no bright beam"):
        learn_area_weighted(even, guide())


# The beam crosses several pixel rows: the errors of the area-weighted centre average out.
INCLINED = bent(0.0, tilt=0.03)
LOOKS = {
    "before black": Look(beam=0.8, ground=0.0, roundness=1.0),
    "before gray": Look(beam=0.8, ground=0.2, roundness=1.0),
    "dark": Look(beam=0.3, ground=0.8, roundness=1.0),
}


# Relative errors of the shift. That of a centroid is exact, but for noise of a hundredth; a fit's
# depends on the form of the profile, and the paper's on its threshold.
WITHIN = {"profile_fit": 0.2, "background_subtracted": 0.08, PAPER: 0.25}


@cache
def tilted_light(tangent: float, name: str) -> Floats:
    """Light of a matt beam, lit from a tangent to its side: sqrt(1 - x^2) + x tangent across it."""
    look, pixels = LOOKS[name], guide().pixels(INCLINED)
    even, rising = (
        cover(pixels, replace(look, roundness=0.0, skew=skew), (HEIGHT, WIDTH))[1]
        for skew in (0.0, 1.0)
    )
    return drawn(guide(), INCLINED, look) + look.beam * tangent * (rising - even)


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("name", "look"),
    [(name, look) for name in EXTRACTORS for look in LOOKS if (name, look) != (PAPER, "dark")],
)
def test_the_shading_moves_each_centreline_as_it_states(
    name: str, look: str, random: np.random.Generator
) -> None:
    """A dark beam before a bright ground moves to the other side than its own brightness."""
    rests = [Sensor()(tilted_light(0.0, look), random) for _ in range(6)]
    extract = EXTRACTORS[name](rests, guide())
    pixels, sides = guide().pixels(INCLINED), []
    for tangent in (-0.5, 0.5):
        light = tilted_light(tangent, look)
        lines = [extract(Sensor()(light, random)) for _ in range(12)]
        sides.append(np.mean([distances(line.points, pixels).mean() for line in lines]))
    moved = (sides[1] - sides[0]) / 2
    expected = extract.shading * SHADING * 0.5 * LOOKS[look].radius_px
    assert abs(expected) > 0.04
    assert moved / expected == pytest.approx(1.0, abs=WITHIN[name])
