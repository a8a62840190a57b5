import math
from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from solver.core.thresholds import THRESHOLDS
from solver.fitting.sliding import ratio_matrix
from tests.solver.methods.pushes import dragged

SIGMA = math.radians(0.01)


def of(degrees: list[float], begins: Sequence[int] = (0,), softest: float = 1.0) -> list[float]:
    """The sign of every frame's sliding; zero where it has a friction ratio of its own."""
    firsts = [i in begins for i in range(len(degrees))]
    made = ratio_matrix(np.radians(degrees), firsts, SIGMA, 0.4 / 120, softest)
    own = made[:, 1:]
    assert (own.sum(axis=1) == (made[:, 0] == 0)).all()  # one unknown each, and no two the same
    assert (own.sum(axis=0) == 1).all()
    return [float(sign) for sign in made[:, 0]]


def test_a_motor_that_pushes_on_drags_the_beam_one_way() -> None:
    assert of([3, 5, 7, 15]) == [1, 1, 1, 1]


def test_on_the_way_back_the_contact_is_held_and_then_slides() -> None:
    assert of([3, 6, 9, 12, 11.9, 11, 9, 6, 3]) == [1, 1, 1, 1, 0, 0, -1, -1, -1]


def test_it_turns_as_often_as_the_motor() -> None:
    assert of([4, 12, 6, 6.5, 9, 14]) == [1, 1, -1, 0, 1, 1]


def test_the_encoders_noise_turns_nothing() -> None:
    assert of([3, 9, 8.98, 9.01, 8.99]) == [1, 1, 1, 1, 1]
    assert of([3, 9, 6, 6.02, 5.99]) == [1, 1, -1, -1, -1]


def test_a_way_that_is_seen_from_its_turn_on_may_have_begun_with_it() -> None:
    assert of([11.5, 9, 6, 3]) == [0, -1, -1, -1]
    assert of([11.5, 9, 6, 12]) == [1, -1, -1, 1]
    assert of([11.5]) == [1]


def test_from_a_free_beam_on_a_way_begins_anew() -> None:
    assert of([6, 12, 3, 6], begins=(0, 2)) == [1, 1, 1, 1]
    assert of([6, 12, 3, 6]) == [1, 1, -1, 1]


def test_at_first_touch_the_beam_may_slide_either_way() -> None:
    assert of([-0.1, 0.3, 0.5, 0.7, 3]) == [0, 0, 0, 1, 1]
    # On a rigid object it slides back first, until it has turned by 2.5 times its slenderness.
    assert of([-0.1, 0.3, 0.5, 0.7, 3], softest=0.0) == [0, -1, 0, 1, 1]


@given(st.lists(st.floats(0.6, 30), min_size=1, max_size=12), st.floats(1, 2))
def test_only_the_shape_of_the_way_counts(degrees: list[float], scale: float) -> None:
    angles, begins = np.radians(degrees), [True] + [False] * (len(degrees) - 1)
    small = ratio_matrix(angles, begins, SIGMA, 0.0, 0.0)
    assert (ratio_matrix(scale * angles, begins, scale * SIGMA, 0.0, 0.0) == small).all()


@pytest.mark.thorough
@pytest.mark.parametrize("friction", [0.1, 0.8])
@pytest.mark.parametrize(("compliance", "radius"), [(0.0, 0.0), (0.0, 0.01), (0.5, 0.0)])
def test_the_world_slides_as_the_antenna_believes(
    friction: float, compliance: float, radius: float
) -> None:
    top = 12.0
    held = THRESHOLDS.held_fraction
    way = (6.0, top, top * (1 - 0.9 * held), top * (1 - 1.1 * held), 6.0)
    states = dragged(0.12, compliance, radius, friction, way)
    signs = []
    for state, _ in states:
        contact = state.contact
        drag = float(contact.force @ contact.tangent) / float(contact.force @ contact.normal)
        signs.append(drag / friction)
    believed = of(list(way))
    assert believed == [1, 1, 0, -1, -1]
    for sign, belief in zip(signs, believed, strict=True):
        assert belief == 0 or sign == pytest.approx(belief, abs=1e-6)
