"""The table of accuracy: chosen figures and methods, and the smallest errors in bold."""

from typing import Any

import pytest

from solver.instrument.errors import InputError
from vbaa_bench.api.results import AccuracyTable
from vbaa_bench.scoring.accuracy import Row
from vbaa_bench.scoring.statistics import SUMMARY, TABLE


def row(scene: str, method: str, **figures: float) -> Row:
    values: dict[str, Any] = dict.fromkeys(SUMMARY | TABLE) | figures
    outcomes = {} if method.startswith("bound") else {"contact": 9}
    return {"scene": scene, "method": method, **values, "n": 9, "outcomes": outcomes, "remark": ""}


TABLE_OF_THREE = AccuracyTable(
    [
        row("a", "first", x_c_rmse_pct_L=0.10004, ms_per_frame_median=2.0, consistent_pct=90.0),
        row("a", "second", x_c_rmse_pct_L=0.10001, ms_per_frame_median=3.0, consistent_pct=80.0),
        row("a", "third", x_c_rmse_pct_L=0.2, ms_per_frame_median=1.0, consistent_pct=70.0),
        row("a", "bound (planar)", x_c_rmse_pct_L=0.01),
        row("b", "third", x_c_rmse_pct_L=0.5),
    ],
    None,
)


def cells(text: str) -> list[list[str]]:
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in text.splitlines()]


def test_figures_are_in_the_order_in_which_they_are_chosen() -> None:
    chosen = ["ms_per_frame_median", "x_c_rmse_pct_L"]
    heads, _, first, *_ = cells(TABLE_OF_THREE.text(columns=chosen))
    assert heads == ["scene", "method", "ms", "x_c RMSE, % of L", "n", "outcomes"]
    assert first == ["a", "first", "2", "0.1", "9", "9 contact"]
    csv = TABLE_OF_THREE.text("csv", columns=chosen).splitlines()
    assert csv[0] == "scene,method,n,ms_per_frame_median,x_c_rmse_pct_L,outcomes"


def test_the_smallest_errors_of_a_scene_are_bold_with_all_that_look_the_same() -> None:
    columns = ["x_c_rmse_pct_L", "ms_per_frame_median", "consistent_pct"]
    lines = cells(TABLE_OF_THREE.text(columns=columns, bold=True))[2:]
    assert [line[2:5] for line in lines] == [
        ["**0.1**", "2", "90"],
        ["**0.1**", "3", "80"],
        ["0.2", "**1**", "70"],
        ["0.01", "–", "–"],
        ["**0.5**", "–", "–"],
    ]
    latex = TABLE_OF_THREE.text("latex", columns=columns, bold=True)
    assert r"a & third & 0.2 & \textbf{1} & 70 & 9 & 9 contact \\" in latex
    assert latex.count(r"\midrule") == 2


def test_methods_are_chosen_and_limits_stay() -> None:
    kept = TABLE_OF_THREE.of(["third"]).rows
    assert [one["method"] for one in kept] == ["third", "bound (planar)", "third"]


def test_unknown_names_are_refused() -> None:
    with pytest.raises(
        InputError, match=r"column 'x_c_rmse_pct' is unknown; did you mean x_c_rmse_pct_L"
    ):
        TABLE_OF_THREE.text(columns=["x_c_rmse_pct"])
    with pytest.raises(InputError, match=r"column 'error' is unknown; known are x_c_rmse_pct_L, "):
        TABLE_OF_THREE.text(columns=["error"])
    with pytest.raises(InputError, match="method 'frist' is unknown; did you mean first"):
        TABLE_OF_THREE.of(["frist"])
