"""The visible side of sections: a circle, a turned ellipse, and one or two faces of a strip."""

import numpy as np
import pytest

from solver.instrument.beam import Beam
from vbaa_bench.limits.section import visible_side
from vbaa_bench.mechanics.rod import Rod

BEAM = Beam(0.24, 0.8e-3, 1.0)
AXES = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
ACROSS, UP = AXES


def turned(angle: float) -> tuple[np.ndarray, np.ndarray]:
    """Return `across` and `towards` for a camera that is turned about the beam."""
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.array([0.0, cosine, -sine]), np.array([0.0, sine, cosine])


@pytest.mark.parametrize("angle", [0.0, 0.7, 2.5])
def test_a_circle_looks_the_same_from_all_sides(angle: float) -> None:
    across, towards = turned(angle)
    side = visible_side(Rod(BEAM), 0.1, AXES, across, towards, 8)
    assert side.half_width == pytest.approx(0.4e-3)
    offsets = (np.arange(8) + 0.5) / 4 - 1
    expected = np.outer(offsets, across) + np.outer(np.sqrt(1 - offsets**2), towards)
    np.testing.assert_allclose(side.normals, expected, atol=1e-4)


def test_a_taper_is_thinner_at_the_tip() -> None:
    side = visible_side(Rod(BEAM, tip_ratio=0.5), 0.24, AXES, ACROSS, UP, 4)
    assert side.half_width == pytest.approx(0.2e-3)


@pytest.mark.parametrize("angle", [0.0, 0.4, 1.5])
def test_an_ellipse_has_the_width_of_its_support(angle: float) -> None:
    across, towards = turned(angle)
    side = visible_side(Rod(BEAM, aspect_ratio=3.0), 0.0, AXES, across, towards, 6)
    expected = 0.4e-3 * np.hypot(np.cos(angle), 3 * np.sin(angle))
    assert side.half_width == pytest.approx(expected)
    assert (side.normals @ towards > 0).all()
    # Normals turn from one side to the other.
    assert (np.diff(side.normals @ across) > 0).all()


def test_faces_of_a_strip_share_the_width_by_their_projections() -> None:
    strip = Rod(BEAM, shape="rectangle", aspect_ratio=4.0)
    # The section's first axis, y, is the strip's thickness: from above its edge is visible.
    face = visible_side(strip, 0.0, AXES, ACROSS, UP, 4)
    assert face.half_width == pytest.approx(0.4e-3)
    np.testing.assert_allclose(face.normals, np.tile(UP, (4, 1)))
    across, towards = turned(np.deg2rad(45))
    both = visible_side(strip, 0.0, AXES, across, towards, 1000)
    assert both.half_width == pytest.approx(0.4e-3 * (1 + 4) / np.sqrt(2))
    on_wide_face = (both.normals @ ACROSS > 0.5).mean()
    assert on_wide_face == pytest.approx(4 / 5, abs=2e-3)
