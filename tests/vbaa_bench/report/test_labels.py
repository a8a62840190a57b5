import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from vbaa_bench.report.figures import LABEL_GAP_PX, speed_against_error
from vbaa_bench.report.labels import spread

PLACES = arrays(float, st.integers(0, 12), elements=st.floats(-1e3, 1e3))


@given(PLACES, st.floats(0.1, 50))
def test_labels_keep_their_order_their_distance_and_their_middle(
    wanted: np.ndarray, gap: float
) -> None:
    found = spread(wanted, gap)
    order = np.argsort(wanted, kind="stable")
    assert np.all(np.diff(found[order]) >= gap * (1 - 1e-9))
    if len(wanted):
        assert abs(found.mean() - wanted.mean()) < 1e-6


def test_labels_that_are_apart_stay_where_they_are() -> None:
    wanted = np.array([30.0, 0.0, 11.0])
    assert np.allclose(spread(wanted, 10), wanted)
    assert np.allclose(spread(np.array([5.0, 5.0, 40.0]), 10), [0, 10, 40])


def test_labels_of_ten_equal_methods_do_not_touch() -> None:
    one = {
        "ms_per_frame_median": 1.0,
        "ms_per_frame_median_95": None,
        "x_c_median_abs_pct_L": 0.03,
        "x_c_median_abs_pct_L_95": None,
    }
    names = [f"method_{i}" for i in range(10)]
    chart = speed_against_error(
        {"methods": dict.fromkeys(names, one)}, dict.fromkeys(names, "black")
    )
    drawn = chart.to_dict()
    (rows,) = drawn["datasets"].values()
    low, high = drawn["layer"][0]["encoding"]["y"]["scale"]["domain"]
    height = drawn["height"]
    at = np.sort([height * np.log(row["label_at"] / low) / np.log(high / low) for row in rows])
    assert len(at) == 10
    assert np.diff(at).min() > LABEL_GAP_PX * 0.999
    assert {row["error"] for row in rows} == {0.03}
