"""Groups of frames by factor: each frame in one group, equal values together."""

import numpy as np
import polars as pl
import pytest

from vbaa_bench.scoring.conditions import FACTOR_PREFIX
from vbaa_bench.scoring.factors import factor_table


def table(values: list[float], consistent: list[bool]) -> pl.DataFrame:
    return factor_table(
        pl.DataFrame(
            {
                "method": "exact_fit",
                "outcome": ["contact" if good else "no contact" for good in consistent],
                "x_c_error_pct_L": [0.1] * len(values),
                "consistent": consistent,
                f"{FACTOR_PREFIX}blur": values,
            }
        )
    )


def test_numbers_are_divided_into_three_equal_groups(random: np.random.Generator) -> None:
    values = random.uniform(0, 3, 150)
    groups = table(list(values), [value < 1.5 for value in values])
    assert groups["frames"].to_list() == [50, 50, 50]
    assert groups["consistent_pct"][0] == groups["answered_pct"][0] == 100
    assert groups["consistent_pct"][2] == groups["answered_pct"][2] == 0
    assert groups["spread"].to_list() == [100.0] * 3


def test_equal_numbers_are_in_one_group() -> None:
    values = [0.0] * 150 + list(np.linspace(0.1, 1, 150))
    groups = table(values, [value == 0 for value in values])
    assert groups["group"][0] == "0"
    assert groups["frames"].sum() == 300
    by_group = dict(groups.select("group", "consistent_pct").iter_rows())
    assert by_group["0"] == 100
    assert [share for group, share in by_group.items() if group != "0"] == [0.0, 0.0]


@pytest.mark.parametrize("values", [[1.0] * 90, [0.0] * 80 + [1.0] * 10])
def test_a_factor_without_two_groups_is_left_out(values: list[float]) -> None:
    assert table(values, [True] * 90).is_empty()
