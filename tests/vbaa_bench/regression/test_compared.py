"""What is compared of each frame."""

import polars as pl

from vbaa_bench.regression.compared import COMPARED


def test_a_sigma_beside_a_failure_does_not_make_a_method_consistent() -> None:
    """As in the summary, whose share of consistent frames is then null."""
    (consistent,) = [one for one in COMPARED if one.column == "consistent_pct"]
    frames = pl.DataFrame(
        {
            "method": ["sigma beside a failure", "sigma beside a failure", "sigma", "sigma"],
            "x_c_error_mm": [1.0, None, 1.0, None],
            "x_c_sigma_mm": [None, 0.1, 0.1, None],
            "consistent": [False, True, False, True],
        }
    )
    assert frames.select(consistent.of_frames()).to_series().to_list() == [None, None, 0, 100]
