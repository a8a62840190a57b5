import re

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from tests.vbaa_bench.report.synthetic import scores
from vbaa_bench.report import speed_chart
from vbaa_bench.report.method_statistics import method_statistics, with_groups
from vbaa_bench.report.palette import styles
from vbaa_bench.report.speed_chart import spread

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
    one = method_statistics(with_groups(scores(60, ("exact_fit",))))["exact_fit"]
    names = [f"method_{n}_{'x' * 20}" for n in range(10)]
    methods = {name: type(one)(**{**vars(one), "method": name}) for name in names}
    scales = speed_chart.axes([methods], [])
    for size in (speed_chart.WIDE, speed_chart.NARROW):
        chart = speed_chart.speed_chart(
            methods.values(), {}, styles(names), dict.fromkeys(names, "m"), scales, size
        )
        labels = re.findall(r'<text x="[\d.]+" y="([\d.]+)" class="m label">([^<]*)', chart)
        heights = np.sort([float(height) for height, _ in labels])
        assert len(heights) == 10
        assert np.diff(heights).min() > speed_chart.LABEL_GAP_PX - 0.2
        assert heights.max() < size[1]
        assert all("…" in text for _, text in labels)
