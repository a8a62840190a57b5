"""What of the beam is seen, from the share of every pixel that it covers."""

import numpy as np
import pytest

from solver.instrument.arrays import Floats
from solver.instrument.camera import Camera
from solver.instrument.transforms import camera_looking_at
from vbaa_bench.render.visibility import Visibility, visibility

LENGTH, RADIUS = 0.2, 0.1e-3
# Half a pixel a millimetre: the beam is 100 px long and a tenth of a pixel wide.
MIDDLE = np.array([0.11, 0.0, 0.0])
CAMERA = Camera(
    120,
    9,
    500.0,
    500.0,
    59.5,
    4.0,
    camera_looking_at(MIDDLE + np.array([0.0, 0.0, 1.0]), MIDDLE, 0.0),
    telecentric=True,
)


def line(offset: float = 0.0, start: float = 0.0) -> Floats:
    """A straight centreline (n, 4) [m], along the rows."""
    s = np.linspace(0, LENGTH, 41)
    return np.column_stack([s, start + s, np.full(41, offset), np.zeros(41)])


def seen(centreline: Floats, hidden: tuple[float, float] = (1.0, 0.0)) -> Visibility:
    """Of a beam that covers a tenth of every pixel it crosses, but for a stretch of it."""
    coverage = np.zeros((9, 120))
    s = np.linspace(0, LENGTH, 5001)
    there = ~((s > hidden[0] * LENGTH) & (s < hidden[1] * LENGTH))
    place = np.column_stack([np.interp(s, centreline[:, 0], axis) for axis in centreline.T[1:]])
    column, row = np.rint(CAMERA.project(place[there])).astype(int).T
    inside = (column >= 0) & (column < 120)
    coverage[row[inside], column[inside]] = 0.1
    return visibility(coverage, CAMERA, centreline, RADIUS)


@pytest.mark.parametrize("offset", [0.0, 0.9e-3, 1.0e-3, 1.1e-3])
def test_a_thin_beam_in_full_view_is_all_seen_on_and_between_rows(offset: float) -> None:
    found = seen(line(offset))
    assert (found.visible_share, found.availability) == (1.0, 1.0)
    assert found.hidden_stretches.shape == (0, 2)


def test_a_cover_hides_a_stretch() -> None:
    found = seen(line(), (0.6, 0.85))
    # Pixels at its ends show a part of the beam still.
    assert found.visible_share == pytest.approx(0.75, abs=0.021)
    assert found.availability == found.visible_share
    assert found.hidden_stretches == pytest.approx(np.array([[0.60, 0.85]]), abs=0.021)


def test_what_is_out_of_the_image_is_hidden_by_nothing() -> None:
    # The image ends where 60 % of the beam do.
    found = seen(line(start=0.23 - 0.6 * LENGTH), (0.2, 0.4))
    assert found.visible_share == pytest.approx(0.4, abs=0.021)
    assert found.availability == pytest.approx(0.4 / 0.6, abs=0.04)
    assert len(found.hidden_stretches) == 1


def test_no_beam_is_no_share() -> None:
    found = visibility(np.zeros((9, 120)), CAMERA, line(), RADIUS)
    assert (found.visible_share, found.availability) == (0.0, 0.0)
    away = visibility(np.zeros((9, 120)), CAMERA, line(start=1.0), RADIUS)
    assert (away.visible_share, away.availability) == (0.0, 0.0)
    assert len(away.hidden_stretches) == 0
