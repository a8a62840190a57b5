"""Images whose rows are of two moments."""

import numpy as np
import pytest

from solver.antenna import Antenna
from solver.instrument.arrays import Grey
from solver.instrument.estimate import Estimate, Outcome
from solver.instrument.images import read_grey
from solver.instrument.interlacing import rows_alternate
from solver.instrument.observation import Observations
from solver.tracker import INTERLACED, PushTracker


def woven(even: Grey, odd: Grey) -> Grey:
    """Take the even rows of one image and the odd rows of another."""
    image = even.copy()
    image[1::2] = odd[1::2]
    return image


def test_progressive_images_do_not_alternate(observations: Observations) -> None:
    paths = (*observations.rest_images, *observations.board_views)
    images = [read_grey(path) for path in paths] + [frame.image() for frame in observations.frames]
    assert not any(map(rows_alternate, images))


def test_noise_alone_does_not_alternate(random: np.random.Generator) -> None:
    noise = random.normal(100, 10, (200, 300)).astype(np.uint8)
    assert not rows_alternate(noise)
    assert not rows_alternate(np.full((20, 30), 7, np.uint8))
    assert not rows_alternate(np.zeros((0, 0), np.uint8))


@pytest.mark.parametrize(("down", "right"), [(2, 0), (0, 3)])
def test_an_image_that_moves_between_fields_alternates(
    observations: Observations, down: int, right: int
) -> None:
    image = observations.frames[0].image()
    assert rows_alternate(woven(image, np.roll(image, (down, right), axis=(0, 1))))


def test_two_poses_of_the_beam_in_one_image_are_named(
    observations: Observations, antenna: Antenna
) -> None:
    first, second = observations.frames[0].image(), observations.frames[1].image()
    # A method may answer such a frame, with a large sigma: only refusals are explained.
    refusing = PushTracker(antenna, lambda _measurement: Estimate(Outcome.INVALID, "no beam"))
    assert INTERLACED in refusing.solve(woven(first, second)).estimate.message
    assert INTERLACED not in refusing.solve(first).estimate.message
