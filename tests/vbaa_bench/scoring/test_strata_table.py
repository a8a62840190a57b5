"""Figures by quantity and stratum, in units of the information limit, and the share of it."""

from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

from solver.instrument.errors import InputError
from solver.instrument.hashes import HASHES
from tests.draws import generator
from tests.vbaa_bench.scoring.worlds import FREE, truth
from vbaa_bench.dataset.derived import write_limits
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.scoring import accuracy
from vbaa_bench.scoring.frame_scores import score_frames, true_frames
from vbaa_bench.scoring.information import efficiency, scored_limits
from vbaa_bench.scoring.information_sets import information_of
from vbaa_bench.scoring.predictions import checked_predictions
from vbaa_bench.scoring.score_columns import LIMITS
from vbaa_bench.scoring.scored_quantities import X_C
from vbaa_bench.scoring.statistics import information_used
from vbaa_bench.scoring.strata import ALL
from vbaa_bench.scoring.strata_table import strata_rows
from vbaa_bench.scoring.summary import summarise, summarise_method


def limits(rows: int, information: str, x_c_mm: list[float | None]) -> pl.DataFrame:
    nothing = pl.Series([None] * rows, dtype=pl.Float64)
    return pl.DataFrame(
        {
            "frame_id": [f"f{i}" for i in range(rows)],
            "information": information,
            **dict.fromkeys(list(LIMITS)[2:], nothing),
            "x_c_limit_mm": pl.Series(x_c_mm, dtype=pl.Float64),
        }
    )


def scored(
    answers: list[dict[str, Any]],
    true: list[dict[str, Any]] | None = None,
    limits: pl.DataFrame | None = None,
    method: str = "exact_fit",
) -> pl.DataFrame:
    rows = [{"frame_id": f"f{i}", "x_c_mm": None, **row} for i, row in enumerate(answers)]
    table = checked_predictions(pl.DataFrame(rows, infer_schema_length=None), "mine")
    world = truth(*(true or [{}] * len(answers)))
    return score_frames(world, table, method, "mine", limits).sort("frame_id")


def separate(count: int) -> list[dict[str, Any]]:
    """Pushes at places of their own, so that each is a group."""
    return [{"contact_distance_at_rest_mm": float(i)} for i in range(count)]


def of(rows: list[dict[str, Any]], quantity: str, stratum: str = ALL) -> dict[str, dict[str, Any]]:
    chosen = [row for row in rows if (row["quantity"], row["stratum"]) == (quantity, stratum)]
    return {row["value"]: row for row in chosen}


def test_each_error_is_divided_by_its_own_limit_before_it_is_averaged() -> None:
    answers = [{"x_c_mm": 120 + error} for error in (1.0, -0.02, 0.5)]
    rows = scored(answers, limits=limits(3, "planar", [0.5, 0.02, None]))
    figures = of(strata_rows(rows), "x_c_mm")[ALL]
    assert figures["bias_over_limit"] == pytest.approx((2 - 1) / 2)
    assert figures["rmse_over_limit"] == pytest.approx(np.sqrt((4 + 1) / 2))
    assert figures["bias"] == pytest.approx(1.48 / 3)
    assert (figures["frames"], figures["answered"]) == (3, 3)
    assert summarise_method(rows)["x_c_rmse_over_limit"] == figures["rmse_over_limit"]
    assert summarise_method(rows)["force_rmse_over_limit"] is None


def test_limits_are_those_of_the_method_s_information_set() -> None:
    both = pl.concat([limits(1, "planar", [1.0]), limits(1, "image", [4.0])])
    answer = {"x_c_mm": 120.0}
    assert scored([answer], limits=both)["x_c_limit_mm"].to_list() == [1.0]
    assert scored([answer], limits=both, method="mine")["x_c_limit_mm"].to_list() == [4.0]
    declared = scored([answer | {"information": "planar"}], limits=both, method="mine")
    assert declared["x_c_limit_mm"].to_list() == [1.0]
    assert scored([answer], limits=both, method="push_fit")["x_c_limit_mm"].to_list() == [None]
    assert scored([answer])["x_c_limit_mm"].to_list() == [None]
    with pytest.raises(InputError, match="information 'all' is unknown, allowed is one of planar"):
        scored([answer | {"information": "all"}])


def test_a_table_of_limits_is_checked_when_it_is_read(tmp_path: Path) -> None:
    layout, table = Layout(tmp_path), limits(2, "planar", [1.0, 2.0])
    layout.truth.mkdir()
    (layout.truth / HASHES).write_text("{}\n", encoding="utf-8")
    assert scored_limits(layout) is None
    write_limits(layout, table)
    assert scored_limits(layout) is not None
    for wrong, message in (
        (table.drop("x_c_limit_mm"), "the column x_c_limit_mm is missing"),
        (table.with_columns(x_c_limit_mm=pl.lit("x")), "x_c_limit_mm holds String, allowed are"),
        (table.with_columns(frame_id=pl.lit("f0")), "a frame has two rows of one information set"),
    ):
        write_limits(layout, wrong)
        with pytest.raises(InputError, match=rf"limits\.parquet: {message}"):
            scored_limits(layout)


@pytest.mark.parametrize("limit", [0.0, -1.0, 5e-324, 1e300, float("inf"), float("nan")])
def test_a_limit_that_is_no_plausible_number_counts_as_none(limit: float) -> None:
    (row,) = scored([{"x_c_mm": 120.0}], limits=limits(1, "planar", [limit])).to_dicts()
    assert row["x_c_limit_mm"] is None


def test_the_information_of_a_fit_in_space_follows_from_the_sensors() -> None:
    sensor: dict[str, Any] = {"moment_sensor": {"sigma_pct": 1}}
    assert information_of("exact_fit_3d@area_weighted", {}) == "image"
    assert information_of("exact_fit_3d", sensor) == "moment"
    assert information_of("two_point@area_weighted", sensor) == "planar"
    assert information_of("my_method.f", sensor) == "image"


def test_failures_count_in_the_stratum_of_their_frame() -> None:
    true: list[dict[str, Any]] = [
        {},
        {"deflection_pct": 20.0},
        {"deflection_pct": 20.0},
        FREE,
        {"visible_share": None},
    ]
    answers: list[dict[str, Any]] = [
        {"x_c_mm": 121.0},
        {"x_c_mm": 118.0},
        {"outcome": "invalid"},
        {"outcome": "contact", "x_c_mm": 100.0},
        {"x_c_mm": None},
    ]
    rows = of(strata_rows(scored(answers, true)), "x_c_mm", "deflection_class")
    assert list(rows) == ["7 to 14 %", "14 to 28 %"]  # the free beam has no error of x_c
    steep = rows["14 to 28 %"]
    assert (steep["frames"], steep["answered"], steep["failed"], steep["refused"]) == (2, 1, 1, 1)
    assert (steep["worst_abs"], steep["worst_frame"]) == (2.0, "f1")
    assert (rows["7 to 14 %"]["frames"], rows["7 to 14 %"]["crashed"]) == (2, 1)


def test_outcomes_are_counted_by_the_true_state() -> None:
    true: list[dict[str, Any]] = [{}, FREE, FREE, {"deflection_pct": 0.001}]
    answers: list[dict[str, Any]] = [
        {"x_c_mm": 120.0},
        {"outcome": "no contact"},
        {"x_c_mm": 100.0},
        {"outcome": "no contact"},
    ]
    confusion = summarise_method(scored(answers, true))["outcome_confusion"]
    assert confusion == {
        "contact": {"contact": 1},
        "no contact": {"contact": 1, "no contact": 1},
        "bend below the noise": {"no contact": 1},
    }


@pytest.fixture(scope="module")
def gaussian() -> np.ndarray:
    return generator(__name__, 3).normal(0, 0.1, 400)


@pytest.mark.false_alarm(1e-6, "14 ends of intervals three times as wide as those of 95 %")
def test_intervals_contain_the_expected_figures(gaussian: np.ndarray) -> None:
    answers = [{"x_c_mm": 120 + error, "x_c_sigma_mm": 0.1} for error in gaussian]
    table = limits(400, "planar", [0.1] * 400)
    figures = of(strata_rows(scored(answers, separate(400), table)), "x_c_mm")[ALL]
    expected = {"rmse": 0.1, "rmse_over_limit": 1, "coverage_68": 0.683, "coverage_95": 0.95}
    for name, value in {**expected, "bias": 0, "bias_over_limit": 0, "nees": 1}.items():
        low, high = figures[f"{name}_low"], figures[f"{name}_high"]
        assert low < figures[name] < high
        # 1.96 standard deviations to either side; three times as much is exceeded once in 10^8.
        assert 2 * low - high < value < 2 * high - low
    # The relative standard error of an RMSE of n Gaussian errors: 1 / sqrt(2 n).
    width = figures["rmse_over_limit_high"] - figures["rmse_over_limit_low"]
    assert width == pytest.approx(2 * 1.96 / np.sqrt(800), rel=0.3)


@pytest.mark.parametrize(
    ("limit", "percent", "impossible"), [(0.09, 81, False), (0.08, 64, False), (0.13, 169, True)]
)
def test_the_share_of_the_information_is_a_sentence(
    gaussian: np.ndarray, limit: float, percent: float, impossible: bool
) -> None:
    answers = [{"x_c_mm": 120 + error} for error in gaussian]
    rows = scored(answers, separate(400), limits(400, "planar", [limit] * 400))
    parameters = strata_rows(rows)
    share = summarise(rows, parameters)["methods"]["exact_fit"]["efficiency"]["x_c_mm"]
    assert share["impossible"] is impossible
    assert ("impossible" in share["sentence"]) is impossible
    assert ("of the information" in share["sentence"]) is not impossible
    assert "in the image and the known plane" in share["sentence"] or impossible
    if impossible:
        # A statement of the rig that is wider than the truth has no share.
        assert share["efficiency_pct"] is share["efficiency_pct_95"] is None
    else:
        low, high = share["efficiency_pct_95"]
        # 1.96 standard deviations to either side, of 7 %.
        assert 2 * low - high < percent < 2 * high - low
        assert share["efficiency_pct"] == pytest.approx(percent, rel=0.4)
    few = {**of(parameters, "x_c_mm")[ALL], "answered": 19}
    assert "impossible" not in (efficiency("planar", X_C, few) or {})["sentence"]


@pytest.mark.parametrize(
    ("ratio", "frames", "share"),
    [
        (0.0, 100, None),
        (2.0, 100, 0.25),
        (0.9, 100, 1 / 0.81),
        (0.7, 100, None),
        (0.7, 10, 1 / 0.49),
    ],
)
def test_a_share_that_chance_does_not_explain_is_not_stated(
    ratio: float, frames: int, share: float | None
) -> None:
    # Frames without a limit do not count.
    rows = pl.DataFrame({"error": [ratio] * frames + [None] * 100})
    used = information_used(pl.col("error"))
    assert used.of(rows) == pytest.approx(share)
    assert rows.select(used.expression).item() == pytest.approx(share)


def test_the_table_takes_the_share_from_frames_with_a_limit() -> None:
    # Chance explains 0.7 times the limit of 10 frames, but not of 110.
    known = limits(110, "planar", [0.1] * 10 + [None] * 100)
    rows = scored([{"x_c_mm": 120.07}] * 110, separate(110), known)
    assert accuracy._row(rows)["x_c_efficiency_pct"] == pytest.approx(100 / 0.49)


def test_without_limits_there_is_no_share() -> None:
    rows = scored([{"x_c_mm": 120.1}, {"x_c_mm": 120.2}])
    found = summarise(rows, strata_rows(rows))["methods"]["exact_fit"]
    assert found["efficiency"] == {}
    assert found["parameters"]["x_c_mm"]["rmse_over_limit"] is None
    assert found["parameters"]["x_c_mm"]["answered"] == 2


def test_friction_is_compared_with_the_scene() -> None:
    world = truth({}, FREE)
    scene = {**world.manifest["scene"], "object": {"friction": 0.3}}
    world.manifest["scene"], before = scene, world.manifest["scene"]
    try:
        table = pl.DataFrame(
            {"frame_id": ["f0", "f1"], "x_c_mm": [120.0, None], "friction": [0.32, None]}
        )
        rows = score_frames(world, checked_predictions(table, ""), "mine", "").sort("frame_id")
    finally:
        world.manifest["scene"] = before
    assert rows["true_friction"].to_list() == [0.3, None]
    assert rows["friction_error"].to_list() == [pytest.approx(0.02), None]


@pytest.mark.parametrize(
    ("touched", "radius"),
    [
        ({"kind": "cylinder", "radius_mm": 8.0}, 8.0),
        ({"kind": "plunger", "nose_radius_mm": 2.0}, 2.0),
        ({"kind": "block", "side_mm": 12.0}, 0.0),
        ({"kind": "mesh", "file": "hexagon.stl"}, None),
    ],
)
def test_the_radius_is_compared_with_that_of_a_round_object(
    touched: dict[str, str | float], radius: float | None
) -> None:
    world = truth({}, FREE)
    scene = {**world.manifest["scene"], "object": touched}
    world.manifest["scene"], before = scene, world.manifest["scene"]
    try:
        rows = true_frames(world).sort("frame_id")
    finally:
        world.manifest["scene"] = before
    assert rows["true_object_radius_mm"].to_list() == [radius, None]
