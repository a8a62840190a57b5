"""Search for the section that describes the beam at rest."""

import numpy as np
import pytest

from solver.centreline import section_search
from solver.centreline.noise import estimate_noise
from solver.centreline.rest_columns import RestColumns
from solver.centreline.stations import stations
from tests.beam_images import WIDTH, Look, Sensor, bent, drawn, guide
from tests.draws import generator


def test_a_section_is_not_better_because_it_shows_fewer_columns() -> None:
    """A beam of less than a pixel, whole and hidden along a third of its length, costs as much."""
    look, random, sensor = Look(radius_px=0.4), generator(__name__, 1), Sensor()
    shape = bent(0.0, tilt=-0.011)
    light = drawn(guide(), shape, look)
    hidden = light.copy()
    hidden[:, WIDTH // 3 : 2 * WIDTH // 3] = np.median(light)
    places = stations(guide().pixels(shape)[::8], light.shape)
    costs = []
    for scene in (light, hidden):
        images = [sensor(scene, random) for _ in range(4)]
        noise = estimate_noise(images)
        rest = RestColumns(images, places, noise, 1, look.radius_px, np.iinfo(images[0].dtype).max)
        section = np.array([1.0, look.spread_px, look.roundness, 0.0, 0.0])
        criterion = section_search._Criterion(1.0, 5)
        costs.append(section_search._cost(rest, section, criterion))
    # Measured: the ratio scatters by 0.03 with the noise. A third of the columns is 0.33.
    assert costs[1] == pytest.approx(costs[0], rel=0.15)
