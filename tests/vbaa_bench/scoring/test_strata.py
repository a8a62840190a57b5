"""Strata by true parameters."""

from typing import Any

import polars as pl

from vbaa_bench.scoring.strata import compared_strata

COLUMNS = {
    "push": pl.String(),
    "contact_distance_at_rest_mm": pl.Float64(),
    "normal_deg": pl.Float64(),
    "k_s_n_m": pl.Float64(),
    "availability_asked": pl.Float64(),
    "hidden_by": pl.String(),
    "hidden_place": pl.String(),
}


def labels(column: str, values: list[Any]) -> list[Any] | None:
    """Labels of the strata of frames that differ in one column."""
    rows = [dict.fromkeys(COLUMNS) | {column: value} for value in values]
    frames, columns = compared_strata(pl.DataFrame(rows, schema=COLUMNS))
    assert frames[columns[0]].to_list() == ["all"] * len(values)
    return frames[columns[1]].to_list() if len(columns) > 1 else None


def test_few_values_give_a_stratum_each() -> None:
    assert labels("push", ["5 %", "10 %"]) == ["push 5 %", "push 10 %"]
    assert labels("normal_deg", [-20.0, 0.0]) == ["normal -20 deg", "normal 0 deg"]
    assert labels("availability_asked", [0.35, 0.6, None]) == ["AR 0.35", "AR 0.6", None]
    assert labels("hidden_by", ["sheet", "removed"]) == ["hidden by sheet", "hidden by removed"]


def test_an_object_without_a_stiffness_is_rigid() -> None:
    assert labels("k_s_n_m", [20.0, None]) == ["k_s 20 N/m", "k_s rigid"]
    many = labels("k_s_n_m", [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, None])
    assert many is not None
    assert many == [*["k_s 1 to 2 N/m"] * 2, *["k_s 3 to 4 N/m"] * 2, *["k_s 5 to 6 N/m"] * 2,
                    "k_s rigid"]  # fmt: skip
    # Four springs and a rigid object are five different stiffnesses.
    assert labels("k_s_n_m", [1.0, 2.0, 3.0, 4.0, None]) == [
        "k_s 1 to 1 N/m", "k_s 2 to 2 N/m", *["k_s 3 to 4 N/m"] * 2, "k_s rigid"
    ]  # fmt: skip


def test_many_numbers_form_three_groups() -> None:
    distances = [60.0, 80.0, 100.0, 120.0, 140.0, 160.0, 180.0]
    groups = labels("contact_distance_at_rest_mm", distances)
    assert groups is not None
    assert groups[0] == groups[1] == "contact at 60 to 80 mm"
    assert groups[2] == groups[3] == "contact at 100 to 120 mm"
    assert groups[4] == groups[6] == "contact at 140 to 180 mm"


def test_what_is_the_same_everywhere_or_too_many_texts_divide_nothing() -> None:
    assert labels("normal_deg", [0.0, 0.0]) is None
    assert labels("k_s_n_m", [None, None]) is None
    assert labels("push", [f"{n} deg" for n in range(9)]) is None
