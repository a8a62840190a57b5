"""The picture shows what the methods were given."""

from pathlib import Path

import numpy as np
import polars as pl
import pytest

from solver.antenna import Antenna
from solver.instrument.images import read_grey
from solver.instrument.observation import Observations
from solver.tracker import extract_centreline
from vbaa_bench.dataset.readers import open_truth
from vbaa_bench.scoring.overlay import force_text, overlay
from vbaa_bench.scoring.results_layout import Results


def test_points_are_those_of_the_solver_and_lie_on_the_true_beam(
    dataset: Path, observations: Observations, antenna: Antenna
) -> None:
    truth = open_truth(dataset / "truth")
    frame = observations.frames[0]
    none = pl.DataFrame(
        schema={"frame_id": pl.String, "failed": pl.Boolean, "method": pl.String, "x_c_mm": float}
    )
    shown = overlay(Results(dataset), truth, none, frame.frame_id, antenna)
    assert shown.measured is not None
    given = extract_centreline(antenna, read_grey(frame.path))
    np.testing.assert_array_equal(shown.measured.points, given.points)
    u, v = shown.measured.points.T
    assert len(u) > 200
    assert np.abs(v - np.interp(u, *shown.centreline.T)).max() < 1
    assert shown.measured.tip is not None
    assert np.linalg.norm(shown.measured.tip - shown.centreline[-1]) < 2
    assert overlay(Results(dataset), truth, none, frame.frame_id).measured is None


@pytest.mark.parametrize(
    ("force_n", "text"),
    [
        (1.612, "1.61 N"),
        (0.0671, "67.1 mN"),
        (0.9996, "1000 mN"),
        (2.5e-5, "25 uN"),
        (1610.0, "1610 N"),
        (0.0, "0 uN"),
    ],
)
def test_a_force_has_a_unit_and_no_powers_of_ten(force_n: float, text: str) -> None:
    assert force_text(force_n) == text
