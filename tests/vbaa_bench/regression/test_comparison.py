"""Comparisons of drawn runs: known changes are found, and unchanged methods raise no alarm."""

from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import get_args

import numpy as np
import polars as pl
import pytest

from solver.instrument.errors import InputError
from tests.vbaa_bench.regression.runs import METHODS, STEPS, Drawn, changed
from vbaa_bench.regression.cells import ALL_SCENES, PairedScene
from vbaa_bench.regression.compared import COMPARED, TIME
from vbaa_bench.regression.comparison import Change, Comparison, Verdict, table
from vbaa_bench.regression.scored_run import ScoredRun, pair

PATH = Path("baseline.json")
run = cache(lambda noise, repeats=10: Drawn(noise, repeats).run())


def compared(old: ScoredRun, new: ScoredRun, name: str = "scene") -> Comparison:
    return table({name: paired(old, new, name)})


def paired(old: ScoredRun, new: ScoredRun, name: str) -> PairedScene:
    return PairedScene(name, pair(old, new, PATH), old.images == new.images, True, False)


def of(comparison: Comparison, method: str, quantity: str, stratum: str = "all") -> Change:
    (change,) = (
        change
        for change in comparison.changes
        if (change.method, change.quantity, change.stratum) == (method, quantity, stratum)
    )
    return change


@pytest.mark.parametrize("repeats", [1, 10])
def test_a_method_made_two_per_cent_worse_is_found(repeats: int) -> None:
    old = run(0, repeats)
    new = changed(old, "x_c_error_pct_L", 1.02, pl.col("method") == "second")
    comparison = compared(old, new)
    assert {change.method for change in comparison.worse} == {"second"}
    assert comparison.better == []
    change = of(comparison, "second", "x_c error")
    assert change.verdict == "worse"
    assert (change.scene, change.pushes) == ("scene", 9 * repeats)
    assert change.new / change.old == pytest.approx(1.02, abs=1e-4)
    back = compared(new, old)
    assert {change.method for change in back.better} == {"second"}
    assert back.worse == []


def test_a_change_in_one_stratum_is_reported_there() -> None:
    old = run(0)
    where = (pl.col("method") == "second") & (pl.col("push") == f"{STEPS[1]} %")
    comparison = compared(old, changed(old, "force_error_pct", 1.3, where))
    reported = {(change.quantity, change.stratum) for change in comparison.worse}
    assert ("force error", f"push {STEPS[1]} %") in reported
    assert not reported & {("force error", f"push {step} %") for step in (STEPS[0], STEPS[2])}


@pytest.mark.thorough
@pytest.mark.false_alarm(3e-6, "binomial, more than 4 of 100 at 0.2 %, as of 600 pairs")
def test_unchanged_methods_with_other_noise_hardly_raise_an_alarm() -> None:
    alarms = [compared(run(2 * n), run(2 * n + 1)) for n in range(100)]
    assert sum(bool(one.worse or one.better) for one in alarms) <= 4


@pytest.mark.false_alarm(3e-6, "binomial, fewer than 5 of 10 at 95 %, as of 20 pairs")
def test_a_method_three_times_worse_is_found_through_other_noise() -> None:
    verdicts = list[Verdict]()
    for n in range(10):
        new = changed(run(2 * n + 1), "x_c_error_pct_L", 3.0, pl.col("method") == "first")
        change = of(compared(run(2 * n), new), "first", "x_c error")
        verdicts.append(change.verdict)
        assert change.smallest is not None
        assert 0.5 < change.smallest / change.old < 5
    assert verdicts.count("worse") >= 5


@pytest.mark.thorough
@pytest.mark.false_alarm(1e-5, "binomial, of 150 pairs 99 % are found, without an alarm")
@pytest.mark.parametrize("same_images", [True, False])
def test_a_slower_method_is_found_and_machine_noise_is_not(same_images: bool) -> None:
    alarms = found = 0
    for n in range(10):
        old, new = run(2 * n), run(2 * n + 1)
        if same_images:
            new = replace(new, images=old.images)
        label = TIME.label
        unchanged = {name: of(compared(old, new), name, label).verdict for name in METHODS}
        alarms += len({"worse", "better"} & set(unchanged.values()))
        slower = changed(new, TIME.column, 1.3, pl.col("method") == METHODS[n % 2])
        verdicts = {name: of(compared(old, slower), name, label).verdict for name in METHODS}
        found += verdicts == unchanged | {METHODS[n % 2]: "worse"}
    assert alarms <= 3
    assert found >= 7


def test_changes_below_the_tolerances_are_not_reported() -> None:
    old = run(0)
    new = changed(old, "x_c_error_pct_L", 1.008, pl.lit(value=True))
    assert of(compared(old, new), "first", "x_c error").p < 0.01
    assert compared(old, new).worse == []
    # Errors of 1e-5 % of L are far below the wavelength of light.
    tiny = changed(old, "x_c_error_pct_L", 1e-3, pl.lit(value=True))
    assert compared(tiny, changed(tiny, "x_c_error_pct_L", 1.5, pl.lit(value=True))).worse == []


def test_frames_that_are_no_longer_answered_are_reported() -> None:
    old = run(0)
    lost = (pl.col("method") == "first") & (pl.col("trial") % 9 == 0)
    values = [quantity.column for quantity in COMPARED if "error" in quantity.column]
    new = replace(
        old,
        frames=old.frames.with_columns(
            pl.when(~lost).then(pl.col(name)).alias(name) for name in values
        ).with_columns(answered_pct=pl.when(lost).then(0.0).otherwise(pl.col("answered_pct"))),
    )
    comparison = compared(old, new)
    assert {(c.method, c.quantity) for c in comparison.worse} == {("first", "frames answered")}
    change = of(comparison, "first", "frames answered")
    assert change.old == 100
    assert change.new == pytest.approx(100 * 8 / 9)


def test_a_doubled_error_of_nine_scattered_pushes_is_not_distinguishable() -> None:
    # Two in three pushes have errors 8 times larger, the third 8 times smaller: twice the typical
    # error, with a t of 1.
    old = run(0, 1)
    first, grown = pl.col("method") == "first", pl.col("trial") // len(STEPS) % 3 < 2
    new = changed(old, "x_c_error_pct_L", 8.0, first & grown)
    new = changed(new, "x_c_error_pct_L", 1 / 8, first & ~grown)
    comparison = compared(old, new)
    change = of(comparison, "first", "x_c error")
    assert (change.pushes, change.verdict) == (9, "not distinguishable")
    assert change.new / change.old == pytest.approx(2, rel=0.01)
    assert change.smallest is None or change.smallest > change.new - change.old
    assert change in comparison.reported
    assert f"{len(comparison.not_distinguishable)} not distinguishable" in comparison.sentence
    assert of(comparison, "second", "x_c error").verdict == "same"


def test_results_of_other_images_are_not_called_the_same() -> None:
    comparison = compared(run(0), run(1))
    change = of(comparison, "first", "x_c error")
    assert change.verdict != "same"
    assert change.smallest is not None
    assert change.smallest > 0.01 * change.old
    # In no push has this changed.
    assert of(comparison, "first", "frames answered").verdict == "same"


def test_small_scenes_are_also_compared_together() -> None:
    old = run(0, 1)
    new = changed(old, "x_c_error_pct_L", 1.05, pl.col("method") == "second")
    few = pl.col("trial") < 12  # four pushes
    parts = [replace(one, frames=one.frames.filter(few)) for one in (old, new)]
    with pytest.raises(InputError, match="fewer than nine pushes"):
        compared(parts[0], parts[1])
    scenes = {name: paired(parts[0], parts[1], name) for name in ("a", "b", "c")}
    comparison = table(scenes)
    assert {change.scene for change in comparison.changes} == {ALL_SCENES}
    assert {change.method for change in comparison.worse} == {"second"}
    assert of(comparison, "second", "x_c error").pushes == 12


def test_frames_are_paired_by_trial_and_true_parameters() -> None:
    old = run(0)
    shuffled = old.frames.sample(fraction=1, shuffle=True, seed=3)
    assert compared(old, replace(old, frames=shuffled)).worse == []
    near = changed(old, "true_x_c_mm", 1.0001, pl.lit(value=True))
    assert pair(old, near, PATH).height == old.frames.height
    far = changed(old, "true_x_c_mm", 1.01, pl.col("trial") < 27)
    assert pair(old, far, PATH)["trial"].min() == 27
    for column in ("true_x_c_mm", "contact_distance_at_rest_mm"):
        with pytest.raises(InputError, match="other true parameters"):
            pair(old, changed(old, column, 1.01, pl.lit(value=True)), PATH)
    renamed = replace(old, frames=old.frames.with_columns(method=pl.lit("new ") + "method"))
    with pytest.raises(InputError, match="no common method"):
        pair(old, renamed, PATH)


def test_times_of_another_processor_are_not_compared() -> None:
    scene = replace(paired(run(0), run(0), "scene"), same_processor=False)
    assert TIME.label not in {change.quantity for change in table({"scene": scene}).changes}


def test_records_hold_plain_values() -> None:
    (record, *_) = compared(run(0), run(1)).records()
    assert {type(value) for value in record.values()} <= {str, int, float, type(None)}
    assert record["verdict"] in get_args(Verdict)
    assert np.isfinite([record["old"], record["new"], record["p"]]).all()
