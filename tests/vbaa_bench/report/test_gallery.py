"""What is drawn on a frame."""

import numpy as np
import pytest

from solver.centreline import Centreline, Flag
from vbaa_bench.report import gallery
from vbaa_bench.scoring.overlay import Overlay


def drawn(flag: Flag | None) -> Overlay:
    """A dark image of a straight beam with one measured point, and one at u = 70 that is not."""
    measured = Centreline(
        points=np.array([[60.0, 40.0]]),
        directions=np.array([[0.0, 1.0]]),
        sigma=np.array([0.05]),
        rejected=np.array([[70.0, 40.0]]),
        flags=np.array([flag or 0], np.uint8),
        tip=np.array([75.0, 44.0]),
        tip_covariance=np.eye(2),
    )
    line = np.column_stack([np.linspace(20.0, 90.0, 15), np.full(15, 40.0)])
    return Overlay(
        frame_id="f0",
        title="",
        image=np.zeros((80, 120), np.uint8),
        centreline=line,
        contact=np.array([65.0, 40.0]),
        measured=measured if flag else None,
        estimates={},
    )


def has(canvas: np.ndarray, colour: tuple[int, int, int]) -> bool:
    return bool((canvas == np.array(colour, np.uint8)).all(axis=2).any())


@pytest.mark.parametrize("flag", list(Flag))
def test_what_was_not_measured_has_the_colour_of_its_reason(flag: Flag) -> None:
    wide, near = gallery.strip(drawn(flag), {}), gallery.close_up(drawn(flag), {})
    for canvas in (wide, near):
        assert [one for one in Flag if has(canvas, gallery.REJECTED[one])] == [flag]
        assert has(canvas, gallery.TIP)
    assert has(near, gallery.POINTS)
    assert not has(wide, gallery.POINTS)  # they would cover the beam


def test_without_a_solver_only_the_truth_is_drawn() -> None:
    near = gallery.close_up(drawn(None), {})
    assert has(near, gallery.TRUTH)
    for colour in (*gallery.REJECTED.values(), gallery.POINTS, gallery.TIP):
        assert not has(near, colour)
