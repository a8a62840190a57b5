"""The permutation test: its rate of false alarms, its power, and what pushes share."""

import numpy as np
import pytest
from scipy.stats import binom

from solver.instrument.arrays import Floats
from tests.draws import generator
from vbaa_bench.regression.permutation_test import FALSE_ALARM, ChangeTable, permutation_test

TABLES = 200
# More alarms than these are raised once in a million runs.
MOST = binom.isf(1e-6, TABLES, FALSE_ALARM)
RARELY = pytest.mark.false_alarm(2e-6, "binomial quantile of 200 tables at the stated rate")


def unshared(pushes: Floats) -> ChangeTable:
    count = pushes.shape[1]
    return ChangeTable(pushes, np.zeros(count), np.arange(count))


def alarms(tables: list[ChangeTable]) -> int:
    rng = generator(__name__, 5)
    return sum(
        bool((permutation_test(table, FALSE_ALARM, rng).p <= FALSE_ALARM).any()) for table in tables
    )


@pytest.mark.thorough
@RARELY
@pytest.mark.parametrize("pushes", [9, 60])
def test_a_whole_table_of_correlated_heavy_tails_rarely_alarms(
    pushes: int, random: np.random.Generator
) -> None:
    tables = []
    for _ in range(TABLES):
        d = random.standard_t(2, size=(pushes, 3)) @ random.standard_normal((3, 40))
        d += 0.3 * random.standard_t(2, size=d.shape)
        d[random.random(d.shape) < 0.2] = np.nan  # not every push is in every stratum
        tables.append(unshared(d))
    assert alarms(tables) <= MOST


@pytest.mark.thorough
@RARELY
def test_what_all_pushes_share_is_no_alarm_if_it_is_stated(random: np.random.Generator) -> None:
    shared, cells = 0.5, 6
    drawn = [
        random.standard_normal((60, cells)) + shared * random.standard_normal(cells)
        for _ in range(TABLES)
    ]
    stated = [ChangeTable(d, np.full(cells, shared), np.arange(cells)) for d in drawn]
    assert alarms(stated) <= MOST
    assert alarms([unshared(d) for d in drawn]) > TABLES / 2


def test_equal_changes_of_all_of_nine_pushes_are_significant() -> None:
    d = np.zeros((9, 50))
    d[:, 7] = 0.02
    p = permutation_test(unshared(d), FALSE_ALARM, generator(__name__, 0)).p
    # All signs are equal in two of 512 swaps.
    assert p[7] == pytest.approx(2 / 512, abs=0.0055)  # +- 0.0009
    assert (np.delete(p, 7) == 1).all()
    d = d[:6]  # two of 64
    assert permutation_test(unshared(d), FALSE_ALARM, generator(__name__, 0)).p[7] > FALSE_ALARM


def test_the_smallest_change_is_the_one_that_becomes_significant() -> None:
    rng = generator(__name__, 3)
    noise = rng.standard_normal((80, 30))
    noise -= noise.mean(axis=0)
    smallest = permutation_test(unshared(noise), FALSE_ALARM, generator(__name__, 0)).smallest
    for factor, significant in ((0.85, False), (1.15, True)):
        moved = noise.copy()
        moved[:, 4] += factor * smallest[4]
        assert (
            permutation_test(unshared(moved), FALSE_ALARM, generator(__name__, 0)).p[4] <= 0.01
        ) is np.bool_(significant)


def test_a_cell_that_can_never_be_significant_has_no_smallest_change() -> None:
    d = generator(__name__, 4).standard_normal((60, 40))
    d[8:, 0] = np.nan
    smallest = permutation_test(unshared(d), FALSE_ALARM, generator(__name__, 0)).smallest
    assert smallest[0] == np.inf
    assert np.isfinite(smallest[1:]).all()
