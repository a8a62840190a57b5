"""What of the beam is seen, read from the truth layers alone."""

from dataclasses import replace

import numpy as np
import pytest

from vbaa_bench.render.layers import Layers, visibility

LENGTH_MM = 200.0


def beam(seen: range, hidden: range) -> Layers:
    """A beam along one row, a hundredth of its length a pixel: parts are seen, parts hidden."""
    layers = Layers.empty(1, 120)
    arc = (np.arange(120, dtype=np.float32) + 0.5)[None] / 100 * LENGTH_MM
    mask, behind = np.zeros((1, 120), np.bool_), np.zeros((1, 120), np.bool_)
    mask[0, seen], behind[0, hidden] = True, True
    return replace(
        layers,
        arc_length_mm=np.where(mask, arc, 0),
        beam_mask=mask,
        occlusion=behind,
        hidden_arc_length_mm=np.where(behind, arc, 0),
    )


def test_a_beam_in_full_view_is_all_seen() -> None:
    found = visibility(beam(range(100), range(0)), LENGTH_MM)
    assert (found.visible_share, found.availability) == (1.0, 1.0)
    assert found.hidden_stretches.shape == (0, 2)


def test_a_cover_hides_a_stretch() -> None:
    found = visibility(beam(range(60), range(60, 85)), LENGTH_MM)
    # The tip is out of the image: nothing hides that.
    assert found.visible_share == pytest.approx(0.6)
    assert found.availability == pytest.approx(60 / 85)
    assert found.hidden_stretches == pytest.approx(np.array([[0.60, 0.85]]))


def test_what_is_seen_beside_a_cover_is_seen() -> None:
    found = visibility(beam(range(100), range(40, 50)), LENGTH_MM)
    assert found.availability == 1.0
    assert len(found.hidden_stretches) == 0


def test_no_beam_is_no_share() -> None:
    found = visibility(Layers.empty(4, 4), LENGTH_MM)
    assert (found.visible_share, found.availability) == (0.0, 0.0)
