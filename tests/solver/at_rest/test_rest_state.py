"""What the rest images show against each other and against the rig."""

from dataclasses import replace
from functools import cache

import cv2
import numpy as np
import pytest

from solver.centreline import Centreline
from solver.centreline.extractor import BeamExtractor
from solver.instrument.arrays import Floats, Grey
from solver.instrument.errors import InputError
from solver.tracker import extract_centreline
from tests.beam_images import LENGTH, Sensor, bent, drawn
from tests.draws import generator
from tests.laboratory import GUIDE, antenna, at_rest

TILT = 3e-3
SENSOR = Sensor()


def image(light: Floats, seed: int, dv: int = 0) -> Grey:
    """Everything in view is moved down by whole pixels."""
    return SENSOR(np.roll(light, dv, axis=0), generator(__name__, seed))


@cache
def still() -> Floats:
    return drawn(GUIDE, bent(0.0, tilt=TILT))


def rested(seed: int) -> Grey:
    return image(still(), seed)


def test_copies_of_an_image_count_once() -> None:
    one, copied = at_rest([rested(1)]), at_rest([rested(1)] * 4)
    assert one.copies == 0
    assert copied.copies == 3
    assert copied.line.y_at_clamp == one.line.y_at_clamp
    assert copied.line.slope == one.line.slope
    assert (copied.line.covariance == one.line.covariance).all()


@pytest.mark.thorough
def test_a_touched_image_is_left_out() -> None:
    touched = image(drawn(GUIDE, bent(0.006, 0.9, TILT)), 3)
    learned = at_rest([rested(1), touched, rested(2)])
    clean = at_rest([rested(1), rested(2)])
    assert learned.rejected == (1,)
    assert learned.line.slope == clean.line.slope
    assert clean.rejected == ()


@pytest.mark.parametrize(
    "moved_by", [[0, 2], pytest.param([0, 0, 1, 1], marks=pytest.mark.thorough)]
)
def test_images_in_different_places_are_refused(moved_by: list[int]) -> None:
    """As image stabilisation leaves them."""
    images = [image(still(), 1 + number, dv) for number, dv in enumerate(moved_by)]
    with pytest.raises(InputError, match=r"in different places, up to [0-9.]+ px apart"):
        at_rest(images)


def test_a_beam_whose_free_end_is_at_the_clamp_is_refused_with_the_mend() -> None:
    s = np.linspace(0, LENGTH + 0.02, 3000)
    turned = image(drawn(GUIDE, np.column_stack([s, TILT * s])), 1)
    mend = r"so turn board\.antenna_from_board_rotation_vector_deg by 180 degrees"
    with pytest.raises(InputError, match=mend):
        at_rest([turned])


@pytest.mark.parametrize("degrees", [pytest.param(-12, marks=pytest.mark.thorough), 12])
def test_a_beam_askew_is_refused(degrees: int) -> None:
    light = drawn(GUIDE, bent(0.0, tilt=np.deg2rad(degrees)))
    with pytest.raises(InputError, match=r"no beam along the rig's x|degrees to the rig's x axis"):
        at_rest([image(light, 1)])


def test_a_bent_beam_shows_what_a_mosaic_does_to_the_beam_at_rest() -> None:
    def demosaiced(light: Floats, seed: int) -> Grey:
        colour = cv2.cvtColor(image(light, seed), cv2.COLOR_BayerBG2BGR)
        return np.ascontiguousarray(colour[..., 1])

    learned = antenna([demosaiced(still(), seed) for seed in range(4)])
    pushed = demosaiced(drawn(GUIDE, bent(0.3, 0.6, TILT)), 4)
    error = extract_centreline(learned, pushed).grid_error
    assert error is not None
    before, after = learned.rest, learned.without(error).rest
    sigmas = [float(np.sqrt(rest.covariance[0, 0])) for rest in (before, after)]
    assert sigmas[1] < sigmas[0] / 10
    # The place may differ by that of the profile's middle, which is the same in all images.
    assert after.slope == pytest.approx(TILT, abs=1e-4)


def other_way() -> list[Grey]:
    """A beam that ends freely where the clamp is stated, and runs on where its tip should be."""
    light = drawn(GUIDE, bent(0.0))
    tip = GUIDE.pixels(np.array([[LENGTH, 0.0]]))[0]
    last = int(tip[0]) - 10
    onwards = np.where(np.arange(light.shape[1]) > last, light[:, last : last + 1], light)
    return [image(onwards, seed) for seed in (1, 2)]


def test_a_beam_that_runs_the_other_way_is_refused() -> None:
    with pytest.raises(InputError, match="free end is at the clamp's position"):
        at_rest(other_way())


def test_an_end_that_is_known_to_some_pixels_only_shows_no_direction(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """As that of a beam that fades before a dark clamp."""
    extract = BeamExtractor.__call__

    def vague(self: BeamExtractor, image: Grey) -> Centreline:
        line = extract(self, image)
        if line.tip_covariance is None:
            return line
        return replace(line, tip_covariance=line.tip_covariance + 3.0**2 * np.eye(2))

    monkeypatch.setattr(BeamExtractor, "__call__", vague)
    assert at_rest(other_way()).tip is None
