"""Information on the end of a beam: known cases, and its dependence on the place in a pixel."""

import numpy as np
import pytest

from solver.instrument.arrays import Floats
from tests.vbaa_bench.limits.test_image_shape import imaged
from vbaa_bench.limits.profile import STEP, SurfaceProfile, edge_information, gray_profile
from vbaa_bench.limits.tip import BeamEnd, tip_information
from vbaa_bench.mechanics.loaded import Load

ACROSS_ROWS = np.array([0.0, 1.0])
ALONG_ROWS = np.array([1.0, 0.0])
BAR = SurfaceProfile(np.full(100, 3.0), 1.0, 2.0, ACROSS_ROWS)


def steady(mean: Floats) -> Floats:
    """Noise with the same variance, 0.01, in all pixels."""
    return np.full_like(mean, 0.01)


def shot(mean: Floats) -> Floats:
    """Noise whose variance is in proportion to the light."""
    return 0.01 * mean


def end(column: float, row: float = 20.0, bulge: float = 0.0) -> BeamEnd:
    return BeamEnd(np.array([column, row]), ALONG_ROWS, bulge)


@pytest.mark.parametrize("column", [10.1, 10.3, 10.4])
@pytest.mark.parametrize("row", [20.0, 20.5])
def test_an_even_bar_ends_in_a_sharp_edge(column: float, row: float) -> None:
    # In rows: 4 full pixels, or 3 full ones and two halves. Each changes by the contrast, 2.
    rows = 4 if row == 20.5 else 3 + 2 * 0.5**2
    expected = 2.0**2 * rows / 0.01
    assert tip_information(BAR, end(column, row), steady) == pytest.approx(expected, rel=1e-6)


def test_the_mean_over_places_in_a_pixel_is_that_of_the_closed_form() -> None:
    places = (np.arange(8) + 0.5) / 8 - 0.5
    values = [tip_information(BAR, end(10 + u, 20 + v), shot) for u in places for v in places]
    # Along the beam the end is an edge at every place across it.
    profile = gray_profile(BAR)
    levels = profile.mean[profile.cover > 0]
    edges = edge_information(BAR.background, levels, ALONG_ROWS, 0.0, shot)
    assert np.mean(values) == pytest.approx(edges.sum() * STEP, rel=0.02)
    # A pixel that the beam covers hardly has a third of the noise of one that it covers.
    assert max(values) > 1.5 * min(values)


def test_an_inclined_end_is_farther_along_in_the_middle() -> None:
    flat = tip_information(BAR, end(10.0), shot)
    assert tip_information(BAR, end(10.0, bulge=1e-9), shot) == pytest.approx(flat, rel=1e-9)
    # With the end 0.3 px before its middle's place, more of the pixels is covered.
    assert tip_information(BAR, end(10.0, bulge=0.15), shot) < 0.95 * flat


def test_the_end_of_a_straight_beam_below_the_camera() -> None:
    beam = imaged(Load(0.14, 1e-9))
    place, along, bulge = BeamEnd.of(beam)
    np.testing.assert_allclose(place, beam.pixels[-1])
    np.testing.assert_allclose(along, [1.0, 0.0], atol=1e-6)
    # The camera is 0.36 m above the beam and 0.12 m before its end.
    assert bulge == pytest.approx(0.12 / np.hypot(0.12, np.hypot(0.36, 0.018)), rel=1e-6)
