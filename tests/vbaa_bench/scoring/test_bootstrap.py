"""Bootstrap intervals over groups."""

import numpy as np
import polars as pl
import pytest

from tests.draws import generator
from vbaa_bench.scoring.bootstrap import MAX_GROUPS, draws, group_numbers, interval, median_interval


def test_intervals_of_the_median(random: np.random.Generator) -> None:
    widths = []
    for _ in range(12):
        values = random.normal(5, 1, 400)
        found = median_interval(pl.Series(values), np.arange(400))
        assert found is not None
        assert found.low < np.median(values) < found.high
        widths.append(found.high - found.low)
    # The median's standard error for a normal sample: 1.253 sigma / sqrt(n).
    assert np.mean(widths) == pytest.approx(2 * 1.96 * 1.253 / 20, rel=0.35)
    assert median_interval(pl.Series([1.0]), np.array([0])) is None
    assert median_interval(pl.Series([2.0, None, -2.0]), np.array([0, 1, 2])) == (2.0, 2.0)


@pytest.mark.parametrize(("frames", "groups"), [(7, 7), (40, 3), (5000, 60)])
def test_the_median_of_each_draw_is_that_of_its_frames(frames: int, groups: int) -> None:
    rng = generator(__name__, frames)
    values, numbers = rng.normal(0, 1, frames), np.arange(frames) % groups
    medians = [
        np.median(np.repeat(np.abs(values), count[numbers].astype(int))) for count in draws(groups)
    ]
    assert median_interval(pl.Series(values), numbers) == pytest.approx(interval(np.array(medians)))


def test_a_few_groups_have_an_unbiased_variance_if_one_less_is_drawn() -> None:
    values = np.array([1.0, 2.0, 6.0])
    counts = draws(3, number=200_000, size=2)
    assert set(counts.sum(axis=1)) == {2.0}
    # The standard error of a mean, s / sqrt(n); draws of all groups are a factor sqrt(2 / 3) below.
    means = counts @ values / 2
    assert np.std(means) == pytest.approx(np.std(values, ddof=1) / np.sqrt(3), rel=0.02)
    assert np.std(draws(3, number=200_000) @ values / 3) < 0.85 * np.std(means)
    assert not np.array_equal(draws(3, number=99), draws(3, number=99, seed=1))


def test_repeats_of_a_push_do_not_narrow_the_interval(random: np.random.Generator) -> None:
    values = random.normal(5, 1, 30)
    once = median_interval(pl.Series(values), np.arange(30))
    ten_times = median_interval(pl.Series(np.repeat(values, 10)), np.repeat(np.arange(30), 10))
    assert once is not None
    assert ten_times is not None
    assert ten_times.high - ten_times.low == pytest.approx(once.high - once.low, rel=0.3)


def pushes(count: int, repeats: int, steps: int) -> pl.DataFrame:
    rows = [
        {
            "push_id": f"{push} {repeat}",
            "push": f"{step + 1}°",
            "step": step,
            "contact_distance_at_rest_mm": float(push),
            "normal_deg": 0.0,
            "k_s_n_m": None,
            "hidden_place": None,
        }
        for push in range(count)
        for repeat in range(repeats)
        for step in range(steps)
    ]
    return pl.DataFrame(rows, infer_schema_length=None).sample(fraction=1, shuffle=True, seed=1)


def test_frames_of_a_push_and_its_repeats_are_one_group() -> None:
    rows = pushes(5, 2, 3)
    numbers = group_numbers(rows)
    assert len(set(numbers)) == 5
    assert len(set(zip(numbers, rows["contact_distance_at_rest_mm"], strict=True))) == 5
    assert len(set(group_numbers(rows, ("push_id",)))) == 10


def test_many_groups_are_merged_evenly() -> None:
    rows = pushes(2 * MAX_GROUPS, 1, 2)
    _, sizes = np.unique(group_numbers(rows), return_counts=True)
    assert list(sizes) == [4] * MAX_GROUPS
