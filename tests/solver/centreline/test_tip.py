"""The free end in drawn images."""

from dataclasses import replace

import numpy as np
import pytest

from solver.centreline import Centreline
from solver.centreline.extractor import learn_profile_fit
from solver.instrument.arrays import Floats, Mask
from tests.beam_images import (
    HEIGHT,
    LENGTH,
    METRES_PER_PIXEL,
    WIDTH,
    Look,
    bent,
    drawn,
    guide,
    longer,
)
from tests.solver.centreline.test_beam import (
    BRIGHT,
    DARK,
    DIAGONAL,
    SENSOR,
    TILT,
    UP,
    learned,
    seen,
)


def pushed(
    theta: float, look: Look = BRIGHT, roll: float = 0.0, by: float = 0.0
) -> tuple[Floats, Floats]:
    """The light of a pushed beam that is longer than it should be `by` [m], and its tip (2,)."""
    shape = bent(theta, 0.6, TILT)
    if by:
        shape = longer(shape, by)
    return drawn(guide(roll), shape, look), guide(roll).pixels(shape)[-1]


def normalised(line: Centreline, tip: Floats) -> float:
    assert line.tip is not None
    assert line.tip_covariance is not None
    off = line.tip - tip
    return float(np.sqrt(off @ np.linalg.solve(line.tip_covariance, off)))


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("look", "roll", "theta"),
    [(BRIGHT, 0.0, 0.2), (DARK, 0.0, 0.15), (BRIGHT, UP, -0.2), (BRIGHT, DIAGONAL, 0.3)],
)
def test_the_tip_is_found_within_its_sigma(look: Look, roll: float, theta: float) -> None:
    light, tip = pushed(theta, look, roll)
    lines = [seen(light, learned(look, roll), seed) for seed in range(6)]
    assert all(normalised(line, tip) < 4 for line in lines)
    for line in lines:
        assert line.tip is not None
        assert np.hypot(*(line.tip - tip)) < 0.2
        # Nothing is measured beyond it.
        beyond = (line.points - tip) @ (tip - line.points[-20])
        assert (beyond < 0).all()


@pytest.mark.parametrize(("roll", "theta"), [(0.0, 0.2), (UP, -0.2)])
def test_the_tip_s_covariance_lies_along_the_beam(roll: float, theta: float) -> None:
    light, _ = pushed(theta, BRIGHT, roll)
    line = seen(light, learned(BRIGHT, roll))
    assert line.tip is not None
    assert line.tip_covariance is not None
    along = line.tip - line.points[-30:].mean(axis=0)
    along /= np.hypot(*along)
    across = np.array([-along[1], along[0]])
    assert np.abs(across).min() > 0.15  # the beam is inclined against rows and columns
    # Across the beam one pixel: the points beside the tip say where it is.
    assert across @ line.tip_covariance @ across == pytest.approx(1.0, rel=0.05)
    assert along @ line.tip_covariance @ along < 0.01
    assert abs(along @ line.tip_covariance @ across) < 0.05


@pytest.mark.thorough
def test_the_tip_follows_no_pixel_grid() -> None:
    off = []
    for part in np.linspace(0, 1, 8, endpoint=False):
        light, tip = pushed(0.1, by=float(part) * 0.5e-3 + 1e-6)
        line = seen(light, learned())
        assert line.tip is not None
        off.append(line.tip[0] - tip[0])
        assert normalised(line, tip) < 4
    assert np.std(off) < 0.05
    assert abs(np.mean(off)) < 0.05


@pytest.mark.thorough
def test_the_tip_of_a_thick_beam_does_not_depend_on_its_climb(random: np.random.Generator) -> None:
    """Its flat end, cut aslant by the columns, is spread over many of them."""
    look = Look(radius_px=4.0)
    thick = replace(guide(), radius=4.0 * METRES_PER_PIXEL)
    rest = drawn(thick, bent(0.0, 0.6, TILT), look)
    beam = learn_profile_fit([SENSOR(rest, random) for _ in range(2)], thick)
    for theta in (-0.02, 0.09, 0.18):
        shape = bent(theta, 0.6, TILT)
        tip = thick.pixels(shape)[-1]
        line = beam(SENSOR(drawn(thick, shape, look), random))
        assert line.tip is not None
        assert abs(line.tip[0] - tip[0]) < 0.1
        assert normalised(line, tip) < 4


@pytest.mark.parametrize("before_px", [16.0, 25.0, 40.0])
def test_a_tip_just_after_the_turn_to_rows_is_found(
    before_px: float, random: np.random.Generator
) -> None:
    """The beam's slope is 45 degrees at this distance from its tip."""
    s = np.linspace(0, LENGTH, 4001)
    angle = np.pi / 4 * s / (LENGTH - before_px * METRES_PER_PIXEL)
    steps = (s[1] - s[0]) * np.column_stack([np.cos(angle), -np.sin(angle)])
    shape = np.vstack([np.zeros(2), (steps[1:] + steps[:-1]).cumsum(axis=0) / 2])
    square = guide(0.0, 320, 320)
    rest = drawn(square, bent(0.0))
    beam = learn_profile_fit([SENSOR(rest, random) for _ in range(2)], square)
    line = beam(SENSOR(drawn(square, shape), random))
    assert line.tip is not None
    tip = square.pixels(shape)[-1]
    assert abs((line.tip - tip) @ np.array([1.0, 1.0]) / np.sqrt(2)) < 0.1
    assert normalised(line, tip) < 4


def behind(mask: Mask, occluder: float) -> Centreline:
    light = drawn(guide(), bent(0.1, 0.6, TILT), BRIGHT, hidden=mask, occluder=occluder)
    return seen(light, learned())


@pytest.mark.false_alarm(0.0, "the values are bounded, whatever is drawn")
@pytest.mark.parametrize("occluder", [0.0, 0.2, 0.7])
@pytest.mark.parametrize("from_tip", [-3, -20, -100])
def test_a_hidden_tip_is_not_told(from_tip: int, occluder: float) -> None:
    u = np.mgrid[:HEIGHT, :WIDTH][1]
    end = guide().pixels(np.array([[LENGTH, 0.0]]))[0, 0]
    line = behind(u > end + from_tip, occluder)
    assert line.tip is None
    assert (line.points[:, 0] < end + from_tip + 1).all()


def test_a_tip_near_something_is_told_with_an_honest_sigma_or_not_at_all() -> None:
    """A thing beside the free end, ever nearer to it, bright and dark."""
    v, u = np.mgrid[:HEIGHT, :WIDTH]
    shape = bent(0.1, 0.6, TILT)
    tip = guide().pixels(shape)[-1]
    told = 0
    for occluder in (0.0, 0.15, 0.5):
        for gap in (2.0, 4.0, 8.0):
            line = behind(np.hypot(u - tip[0] - gap - 10, v - tip[1]) < 10, occluder)
            if line.tip is not None:
                told += 1
                assert normalised(line, tip) < 4
    assert told >= 3


def test_a_tip_out_of_the_image_is_not_told() -> None:
    light = drawn(guide(), bent(0.7, 0.4, TILT), BRIGHT)
    assert seen(light, learned()).tip is None
    # And one that leaves at the end.
    light, tip = pushed(0.0, by=0.02)
    assert tip[0] > WIDTH
    assert seen(light, learned()).tip is None
