"""The ladder's rungs, and the table of what each of them divides the error by."""

from pathlib import Path

import numpy as np
import pytest

from results.ladder.measure import Errors, Ladder, measure
from results.ladder.rungs import LIMIT, every_pair, rungs_of
from solver.beams.linear import unit_deflection
from solver.instrument.errors import InputError
from solver.instrument.observation import Observations
from solver.tracker import PushTracker
from tests.simulated import measurement
from vbaa_bench.dataset.readers import open_truth

SIGMA = 1e-6


def test_all_pairs_of_a_linear_beam_have_its_contact() -> None:
    x, x_c = np.linspace(0.01, 0.23, 60), 0.12
    y = 0.02 * unit_deflection(x, x_c) / unit_deflection(0.24, x_c)
    estimate = every_pair(measurement(np.column_stack([x, y]), SIGMA))
    assert estimate.x_c_mm == pytest.approx(1e3 * x_c, abs=1e-6)
    # The candidates of the paper, before and beyond the contact.
    (x1, x2), (y1, y2) = x[[5, 15]], y[[5, 15]]
    curved = (x1**3 * y2 - x2**3 * y1) / (3 * (x1**2 * y2 - x2**2 * y1))  # (15)
    (x1, x2), (y1, y2) = x[[40, 50]], y[[40, 50]]
    straight = 3 * (x1 * y2 - x2 * y1) / (y2 - y1)  # (19)
    assert [curved, straight] == pytest.approx([x_c, x_c], abs=1e-9)
    behind = measurement(np.column_stack([x, 1e-3 * x]), SIGMA)
    assert not every_pair(behind).values


def test_rungs_get_nearer_to_the_contact(dataset: Path, observations: Observations) -> None:
    truth = open_truth(dataset / "truth", centrelines=False).frames
    true = dict(truth.select("frame_id", "x_c_mm").iter_rows())
    rms = {}
    for rung in rungs_of(observations):
        tracker = PushTracker(rung.antenna, rung.method)
        errors = [
            tracker.solve(frame.image(), frame.readings, frame.push_id).estimate.x_c_mm
            - true[frame.frame_id]
            for frame in observations
        ]
        rms[rung.name] = float(np.sqrt(np.mean(np.square(errors))))
    assert list(rms)[-3:] == ["exact beam", "clamp, calibration", "light"]
    assert max(list(rms.values())[4:]) < min(list(rms.values())[:4]) / 5


def test_factors_and_shares_of_the_rungs() -> None:
    sizes = {"first": 8.0, "worse": 16.0, LIMIT: 1.0}
    signs = np.array([1.0, -1.0, 1.0, np.nan])
    errors = [Errors(name, size * signs, size * signs) for name, size in sizes.items()]
    ladder = Ladder("set", errors, np.array(["5 %", "5 %", "10 %", "20 %"]), np.arange(4))
    first, worse, limit = ladder.rows()
    assert [row["divides_by"] for row in (first, worse, limit)] == [1.0, 0.5, 16.0]
    shares = [row["share_pct"] for row in (first, worse, limit)]
    assert shares == pytest.approx([0, -100 / 3, 400 / 3])
    assert (first["frames"], first["answered"], first["x_c_rmse_pct_L_at_5_pct"]) == (4, 3, 8.0)
    assert np.isnan(first["x_c_rmse_pct_L_at_20_pct"])
    assert first["x_c_median_abs_pct_L"] == 8.0
    # Half of normal errors are within 0.674 standard deviations.
    assert limit["x_c_median_abs_pct_L"] == pytest.approx(0.674, abs=0.01)


def test_a_dataset_without_limits_is_refused(dataset: Path) -> None:
    with pytest.raises(InputError, match="has no information limits; run vbaa-bench limits"):
        measure(dataset, lambda: None)
