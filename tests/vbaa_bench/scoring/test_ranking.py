"""Ranks by a paired bootstrap: ties are ties."""

import numpy as np
import polars as pl
import pytest

from vbaa_bench.scoring.bootstrap import draws, interval, median_interval
from vbaa_bench.scoring.ranking import (
    TIME_OVER_REFERENCE,
    by_solve,
    is_smaller,
    ranks,
    statistic_draws,
)
from vbaa_bench.scoring.scored_quantities import X_C
from vbaa_bench.scoring.statistics import SUMMARY, error_statistics

PUSHES = 60
GROUPS = np.arange(PUSHES)
COUNTS = draws(PUSHES)
MEDIAN = SUMMARY["x_c_median_abs_pct_L"]


def median_draws(errors: np.ndarray) -> np.ndarray:
    rows = pl.DataFrame({"x_c_error_pct_L": errors})
    return statistic_draws(MEDIAN, rows, GROUPS, COUNTS)


def test_methods_with_the_same_errors_on_other_pushes_are_tied() -> None:
    high, low = np.tile([1.1, 1.0], PUSHES // 2), np.tile([1.0, 1.1], PUSHES // 2)
    better = 0.5 * low
    found = ranks({name: median_draws(e) for name, e in (("a", high), ("b", low), ("c", better))})
    assert found == {"c": 1, "a": 2, "b": 2}


def test_a_small_difference_on_every_push_is_found_despite_hard_pushes(
    random: np.random.Generator,
) -> None:
    # Errors of pushes differ by a factor of ten; alone, the intervals of both medians overlap.
    errors = 10 ** random.uniform(-1, 0, PUSHES)
    one, other = median_draws(errors), median_draws(1.02 * errors)
    intervals = interval(one), interval(other)
    assert intervals[0] is not None
    assert intervals[1] is not None
    assert intervals[0].high > intervals[1].low
    assert ranks({"one": one, "other": other}) == {"one": 1, "other": 2}
    assert not is_smaller(one, other, margin=0.05)
    assert is_smaller(one, 2 * other, margin=0.05)


def test_draws_are_those_of_the_declared_statistics(random: np.random.Generator) -> None:
    errors = random.normal(0, 1, PUSHES)
    rows = pl.DataFrame(
        {
            X_C.error: np.where(GROUPS % 7 == 0, np.nan, errors),
            X_C.sigma: 1.0,
            X_C.in_sigmas: np.where(GROUPS % 7 == 0, np.nan, errors),
        }
    ).fill_nan(None)
    counts = np.vstack([np.ones(PUSHES), COUNTS[:1]])
    drawn = rows[np.repeat(GROUPS, COUNTS[0].astype(int)).tolist()]
    for name in ("rmse", "median_abs", "within_3_sigma", "sigma_over_rmse"):
        statistic = error_statistics(X_C)[name]
        wanted = [statistic.of(rows), statistic.of(drawn)]
        assert statistic_draws(statistic, rows, GROUPS, counts) == pytest.approx(wanted)


def test_one_push_and_no_value_rank_nothing() -> None:
    one = statistic_draws(MEDIAN, pl.DataFrame({"x_c_error_pct_L": [1.0]}), np.array([0]), draws(1))
    empty = pl.Series("x_c_error_pct_L", [None] * PUSHES, pl.Float64)
    none = statistic_draws(MEDIAN, empty.to_frame(), GROUPS, COUNTS)
    assert np.isnan(one).all()
    assert np.isnan(none).all()
    assert ranks({"one": one, "other": 2 * one}) == {"one": 1, "other": 1}


def test_a_draw_without_any_value_has_no_median() -> None:
    values = pl.Series([1.0, None, None])
    counts = np.array([[1.0, 1, 1], [0, 2, 1]])
    rows = pl.DataFrame({"x_c_error_pct_L": values})
    found = statistic_draws(MEDIAN, rows, np.arange(3), counts)
    assert found[0] == 1
    assert np.isnan(found[1])
    assert median_interval(values, np.arange(3)) is None


def test_only_times_beside_the_kernel_are_comparable() -> None:
    rows = pl.DataFrame({"processor_ms": [2.0, 3.0, 4.0], "reference_ms": [1.0, None, 0.0]})
    assert TIME_OVER_REFERENCE.of(rows) == 2
    names = ("exact_fit", "two_point@area_weighted", "mine.solve", "mine", "my-file")
    assert [by_solve(name) for name in names] == [True, True, True, False, False]
