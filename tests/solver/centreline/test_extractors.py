"""Every way of measuring the beam learns from rest images; the paper's knows one kind of beam."""

import numpy as np
import pytest

from solver.centreline.extractors import EXTRACTORS, learn_area_weighted
from solver.instrument.arrays import Grey
from solver.instrument.errors import InputError
from tests.beam_images import Look, Sensor, bent, distances, drawn, guide
from tests.draws import generator


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
