import math
import sys

import pytest

from results.mechanics.measure import NOT_INSTALLED, measure, rows


def test_every_model_says_its_speed_and_its_error_without_the_yardstick(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setitem(sys.modules, "elastica", None)
    record = measure(1.0, flat=4, compared=2, spatial=2)
    assert record["yardstick"] is None
    for model in ("planar", "space_plain", "space_all_effects"):
        found = record[model]
        assert found.pop("times_yardstick") is None
        assert all(math.isfinite(number) and number > 0 for number in found.values())
        assert found["worst_relative_error"] < 1e-9
        assert found["worst_residual"] < 1e-8
        assert found["states"] == (4 if model == "planar" else 2)
    models, *_, remarks = zip(*rows(record), strict=True)
    assert models == ("planar", "space plain", "space all effects", "yardstick")
    assert remarks[-1] == NOT_INSTALLED


def test_a_yardstick_that_ran_out_of_time_says_so() -> None:
    one = {
        "states_per_s": 100.0,
        "states_per_s_without_centreline": 200.0,
        "worst_relative_error": 1e-13,
        "worst_residual": 2e-13,
        "cold_start_s": 1.0,
        "times_yardstick": 6000.0,
    }
    found = {"states_per_s": 1 / 60, "tip_error_pct_L": 3.0, "at_rest": False, "elements": 50}
    models = dict.fromkeys(("planar", "space_plain", "space_all_effects"), one)
    said = rows({**models, "yardstick": found})
    assert said[0][1:4] == ("100", "> 6,000", "2.0e-13")
    assert said[3][1:4] == ("< 0.0167", "1", "3.0e-02")
    assert "not yet at rest after 60 s" in said[3][4]
