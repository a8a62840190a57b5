"""Statistics of the report against direct computations."""

import numpy as np
import polars as pl
import pytest

from tests.vbaa_bench.report.synthetic import METHODS, limited, scores
from vbaa_bench.report import headline, palette, speed_chart
from vbaa_bench.report.coverage import calibrations
from vbaa_bench.report.heat_map import heat_maps, with_bins
from vbaa_bench.report.method_statistics import MethodStatistics, method_statistics, with_groups
from vbaa_bench.report.outcomes import messages, outcomes
from vbaa_bench.scoring.scored_quantities import X_C
from vbaa_bench.scoring.strata import reported_strata
from vbaa_bench.scoring.summary import calibration


@pytest.fixture(scope="module")
def table() -> pl.DataFrame:
    return with_groups(limited(scores(4000)))


@pytest.fixture(scope="module")
def methods(table: pl.DataFrame) -> dict[str, MethodStatistics]:
    return method_statistics(table)


def test_statistics_are_those_of_all_frames(
    table: pl.DataFrame, methods: dict[str, MethodStatistics]
) -> None:
    second = methods["two_point"]
    rows = table.filter(pl.col("method") == "two_point")
    errors = rows["x_c_error_pct_L"].drop_nulls().to_numpy()
    assert (second.frames, second.contacts, second.free) == (4000, 3600, 400)
    assert second.answered == len(errors) == 3400
    assert second.median == pytest.approx(np.median(np.abs(errors)))
    assert second.figures["p95"] == pytest.approx(np.quantile(np.abs(errors), 0.95))
    assert second.figures["rmse"] == pytest.approx(np.sqrt(np.mean(errors**2)))
    everything = np.concatenate([errors, np.full(200, 50.0)])
    assert second.figures["rmse_all"] == pytest.approx(np.sqrt(np.mean(everything**2)))
    assert second.figures["coverage_95"] == pytest.approx(95, abs=2.1)
    assert second.share_answered == pytest.approx(3400 / 3600)


def test_efficiency_is_the_squared_ratio_of_limit_and_error(
    methods: dict[str, MethodStatistics],
) -> None:
    # The first method attains the limit; the second has twice its error, a quarter of its use.
    assert methods["exact_fit"].figures["efficiency"] == pytest.approx(100, rel=0.18)
    assert methods["two_point"].figures["efficiency"] == pytest.approx(25, rel=0.18)
    without = method_statistics(with_groups(scores(100)))
    assert without["exact_fit"].figures["efficiency"] is None


def test_the_limit_line_is_the_median_error_of_an_efficient_method(
    table: pl.DataFrame, methods: dict[str, MethodStatistics]
) -> None:
    lines = speed_chart.limit_lines(table)
    assert lines["planar"] == pytest.approx(methods["exact_fit"].median, rel=0.12)


def test_strata_divide_the_frames(table: pl.DataFrame) -> None:
    found = reported_strata(table, str)
    assert found[0].label == "all frames"
    headings = dict.fromkeys(stratum.heading for stratum in found[1:])
    assert {"deflection", "contact distance", "inclination psi", "availability ratio"} <= set(
        headings
    )
    assert "hidden by" not in headings
    for heading in headings:
        parts = [table.filter(one.contains).height for one in found if one.heading == heading]
        defined = (
            table.height if heading != "contact distance" else table.filter(~pl.col("free")).height
        )
        if heading in ("deflection", "availability ratio", "contact distance"):
            assert sum(parts) == defined
        assert all(parts)
    wide = table.with_columns(deflection_pct=pl.Series(np.linspace(1, 20, table.height)))
    thirds = [one for one in reported_strata(wide, str) if one.heading == "deflection"]
    sizes = [wide.filter(one.contains).height for one in thirds]
    assert sum(sizes) == table.height
    assert max(sizes) - min(sizes) <= 1


def test_heat_maps_show_the_error_over_the_limit(table: pl.DataFrame) -> None:
    binned, bins = with_bins(table)
    assert bins.relative
    assert list(bins.rows) == ["5 %", "10 %", "20 %"]
    assert list(bins.columns) == ["60", "100", "140", "180", "220"]
    maps = {one.method: one for one in heat_maps(binned, bins, METHODS)}
    cells = [cell for _, row in maps["two_point"].rows for cell in row]
    assert len(cells) == 15
    assert all(float(cell.text) == pytest.approx(2, rel=0.35) for cell in cells)
    plain, absolute = with_bins(with_groups(scores(4000)))
    assert not absolute.relative
    (first, *_) = heat_maps(plain, absolute, METHODS)
    rmse = [[float(cell.text) for cell in row] for _, row in first.rows]
    assert np.mean(rmse, axis=1) == pytest.approx([0.01, 0.02, 0.04], rel=0.13)


def test_calibration_curves_are_actual_shares(table: pl.DataFrame) -> None:
    found = {(one.method, one.quantity): one for one in calibrations(table, METHODS)}
    right, narrow = found["exact_fit", "contact distance"], found["exact_fit", "force"]
    assert right.at(0.68) == pytest.approx(68, abs=4.1)
    assert right.at(0.95) == pytest.approx(95, abs=2)
    # Errors of two sigmas: erf(0.98 / sqrt 2).
    assert narrow.at(0.95) == pytest.approx(67.3, abs=4.1)
    assert narrow.nees == pytest.approx(4, rel=0.13)


def test_page_and_summary_state_the_same_coverage() -> None:
    # Between 0.9945, the two-sided 68 % quantile, and 1, and between 1.95996 and 1.96.
    answered = scores(40, ("exact_fit",)).drop_nulls("x_c_error_mm")
    sizes = np.resize([0.5, 0.996, 1.5, 1.95998, 3.0], answered.height)
    table = answered.with_columns(pl.Series("x_c_error_in_sigmas", sizes), x_c_sigma_mm=1.0)
    stated = calibration(table, X_C)
    assert stated is not None
    shown = next(one for one in calibrations(table, METHODS) if one.quantity == "contact distance")
    assert shown.at(0.68) == pytest.approx(100 * stated["coverage_68"])
    assert shown.at(0.95) == pytest.approx(100 * stated["coverage_95"])
    (of_method,) = method_statistics(with_groups(table)).values()
    assert of_method.figures["coverage_95"] == pytest.approx(100 * stated["coverage_95"])


def test_equal_rows_of_outcomes_are_joined(table: pl.DataFrame) -> None:
    found = outcomes(table, METHODS)
    assert found.trivial == []
    columns = [("contact", "contact", "right"), ("contact", "invalid", "wrong")]
    assert list(found.columns) == [*columns, ("no contact", "no contact", "right")]
    assert {tuple(row.methods): list(row.counts) for row in found.rows} == {
        tuple(name for name in METHODS if name != "two_point"): [3600, 0, 400],
        ("two_point",): [3400, 200, 400],
    }
    touched = table.filter(~pl.col("free"))
    assert len(outcomes(touched, METHODS).trivial) == 5
    (message,) = messages(table)
    assert (message["frames"], message["methods"]) == (200, ["two_point"])


def test_the_summary_names_the_most_accurate_and_the_fastest(
    methods: dict[str, MethodStatistics],
) -> None:
    best = str(headline.summary(list(methods.values())))
    assert "Most accurate: <b>exact_fit</b>" in best
    assert "It is also the fastest" in best
    assert "cannot be distinguished" not in best
    assert "yours" in speed_chart.omitted(methods.values())
    assert "no time was measured" in speed_chart.omitted(methods.values())


def test_limits_on_the_same_line_have_one_label(methods: dict[str, MethodStatistics]) -> None:
    drawn = list(methods.values())
    scales = speed_chart.axes([methods], [{"planar": 0.01, "image": 0.3}])
    look = (palette.styles(METHODS), dict.fromkeys(METHODS, "m0"), scales)
    apart = speed_chart.speed_chart(drawn, {"planar": 0.01, "image": 0.3}, *look)
    assert apart.count('class="limit"') == 2
    assert "limit, psi known 0.01 %" in apart
    assert "limit, psi unknown 0.3 %" in apart
    same = speed_chart.speed_chart(drawn, {"planar": 0.01, "image": 0.0101}, *look)
    assert same.count('class="limit"') == 1
    assert "limit 0.01 %" in same
    assert "limit, the image and the known plane: 0.01 %; limit, the image: 0.01 %" in same
    for chart in (apart, same):
        assert chart.count('class="claim"') == 1
        assert "paper, 2 %" in chart


def test_cells_of_few_frames_are_gray_and_without_colour_in_the_legend() -> None:
    few = with_bins(with_groups(scores(40, ("exact_fit",))))
    binned, bins = few
    (one,) = heat_maps(binned, bins, ["exact_fit"])
    cells = [cell for _, row in one.rows for cell in row if cell.level is not None]
    counted = sum(cell.frames for cell in cells)
    assert counted == binned["x_c_error_pct_L"].count()
    assert {cell.few for cell in cells} == {cell.frames < 5 for cell in cells}
    enough = {cell.level for cell in cells if cell.frames >= 5}
    assert {level for level, _ in bins.legend([one])} == enough


def test_no_winner_is_named_among_methods_that_cannot_be_distinguished() -> None:
    table = scores(400, ("exact_fit", "two_point", "mine"))
    error = pl.col("x_c_error_pct_L").first().over("frame_id")
    # Equal to the fifth digit, and on which pushes they are better is a matter of rounding; the
    # second is faster by the noise of times, and states a time of its own.
    even = pl.col("frame_id").str.slice(1).cast(pl.Int64) % 2 == 0
    first = pl.col("method") == "exact_fit"
    table = table.with_columns(
        x_c_error_pct_L=error * (1 + 1e-5 * (first == even).cast(pl.Float64)),
        failed=False,
        processor_ms=pl.when(pl.col("method") == "mine").then(0.1).otherwise(2.0)
        + pl.when(first).then(0.0).otherwise(0.05),
        reference_ms=1.0,
    )
    found = method_statistics(with_groups(table))
    text = str(headline.summary([found[name] for name in ("exact_fit", "two_point", "mine")]))
    tied = "<b>exact_fit</b>, <b>two_point</b> and <b>mine</b>, which cannot be distinguished"
    assert f"Most accurate: {tied}, with median errors of <b>0.0" in text
    assert "Fastest: <b>exact_fit</b> and <b>two_point</b>, which cannot be distinguished" in text
    few = with_groups(table.filter(pl.col("frame_id") < "f000005"))
    not_compared = "Methods are not compared: there are fewer than 6 pushes, or rigs."
    assert headline.summary(list(method_statistics(few).values())) == not_compared
