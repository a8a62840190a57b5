"""Maps in a few numbers: of limits whose size is known."""

from dataclasses import replace

import pytest

from tests.vbaa_bench.limits.synthetic import DESIGNS, table
from vbaa_bench.limits.requirements import requirements
from vbaa_bench.limits.summaries import summaries

REQUIRED = requirements(["x_c_pct_L=0.2,force_mn=0.3"], "image")


def test_the_spread_is_over_the_places_in_reach() -> None:
    first, second = summaries(table(), DESIGNS, REQUIRED)
    assert (first.places, first.reached) == (6, 5)
    # 1 / 5, 1 / 5, 1 / 5, 1 / 10, 1 / 10.
    assert first.spreads["x_c_pct_L"] == pytest.approx((0.2, 0.1, 0.2))
    assert second.spreads["x_c_pct_L"] == pytest.approx((0.4, 0.2, 0.4))
    assert first.spreads["psi_deg"] == (0.1, 0.1, None)  # the worst cannot be determined
    assert "compliance_mm_per_n" not in first.spreads


def test_shares_are_of_places_that_fulfil_a_requirement_and_all() -> None:
    first, second = summaries(table(), DESIGNS, REQUIRED)
    # 10 / 50 and 10 / 80 mN are below 0.3, at three of five places.
    assert first.fulfilled == pytest.approx((1.0, 0.6))
    assert first.all_fulfilled == pytest.approx(0.6)
    assert second.fulfilled == pytest.approx((0.4, 0.6))
    assert second.all_fulfilled == pytest.approx(0.2)


def test_what_cannot_be_determined_fulfils_nothing() -> None:
    first, _ = summaries(table(), DESIGNS, requirements(["psi_deg=5"], "image"))
    assert first.fulfilled == pytest.approx((0.8,))


def test_an_impossible_design_is_a_row_without_places() -> None:
    impossible = replace(DESIGNS[0], name="300", reason="too long")
    (summary,) = summaries(table(), [impossible], REQUIRED)
    assert (summary.places, summary.reached, summary.reason) == (0, 0, "too long")
    assert summary.record()["spreads"] == {}
