"""Errors, refusals and stated errors, of truths written by hand."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import polars as pl
import pytest
from hypothesis import given
from hypothesis import strategies as st

from solver.instrument.errors import InputError
from solver.instrument.estimate import Outcome
from tests.vbaa_bench.scoring.worlds import FREE, truth
from vbaa_bench.dataset.document import LARGEST
from vbaa_bench.scoring.frame_scores import score_frames
from vbaa_bench.scoring.predictions import checked_predictions
from vbaa_bench.scoring.refusals import right_refusals
from vbaa_bench.scoring.scored_quantities import SCORED_QUANTITIES
from vbaa_bench.scoring.strata_table import strata_rows
from vbaa_bench.scoring.summary import calibration, summarise_method


def scored(true: list[dict[str, Any]], answers: list[dict[str, Any] | None]) -> pl.DataFrame:
    """Scores of answers to frames in order; None is a frame without an answer."""
    rows = [
        {"frame_id": f"f{i}", "x_c_mm": None, "outcome": None, **answer}
        for i, answer in enumerate(answers)
        if answer is not None
    ]
    table = checked_predictions(pl.DataFrame(rows, infer_schema_length=None), "mine")
    return score_frames(truth(*true), table, "mine", "mine").sort("frame_id")


def one(true: dict[str, Any], answer: dict[str, Any]) -> dict[str, Any]:
    return scored([true], [answer]).row(0, named=True)


@pytest.mark.thorough
@pytest.mark.false_alarm(0.0, "the values are bounded, whatever is drawn")
@given(st.floats(-180, 180), st.floats(-180, 180))
def test_the_error_of_an_angle_is_the_shorter_way_round(true: float, stated: float) -> None:
    row = one({"psi_deg": true}, {"x_c_mm": 120.0, "psi_deg": stated})
    apart = np.exp(1j * np.radians(stated)) / np.exp(1j * np.radians(true))
    assert abs(row["psi_error_deg"]) <= 180
    assert np.exp(1j * np.radians(row["psi_error_deg"])) == pytest.approx(apart, abs=1e-9)


def test_compliance_is_judged_in_per_cent_of_springs_and_in_mm_per_n_of_rigid_objects() -> None:
    contact = {"x_c_mm": 120.0, "compliance_sigma_mm_per_n": 0.02}
    rows = scored(
        [{"k_s_n_m": 100.0}, {}, FREE],
        [
            {**contact, "compliance_mm_per_n": 10.5},
            {**contact, "compliance_mm_per_n": -0.01},
            {"outcome": "no contact"},
        ],
    )
    assert rows["true_compliance_mm_per_n"].to_list() == [10.0, 0.0, None]
    assert rows["compliance_error_pct"].to_list() == [pytest.approx(5.0), None, None]
    found = summarise_method(rows)
    assert found["compliance_rmse_pct"] == pytest.approx(5.0)
    assert found["compliance_rigid_rmse_mm_per_n"] == pytest.approx(0.01)
    assert found["calibration"]["compliance_rigid"]["coverage_95"] == 1
    assert found["calibration"]["compliance"]["coverage_95"] == 0.5


def test_of_a_push_the_last_frame_counts_by_itself() -> None:
    steps = [{"k_s_n_m": 100.0, "push_id": "p", "step": step} for step in (2, 0, 1)]
    stated = [10.1, 20.0, 15.0]
    answers = [{"x_c_mm": 120.0, "compliance_mm_per_n": value} for value in stated]
    found = summarise_method(scored(steps, list(answers)))
    assert found["compliance_last_rmse_pct"] == pytest.approx(1.0)
    assert found["compliance_rmse_pct"] > 50


def test_errors_of_vectors_are_lengths() -> None:
    names = {
        f"contact_antenna_{axis}_mm": at for axis, at in zip("xyz", (123.0, 8.0, 4.0), strict=True)
    }
    row = one({}, {"x_c_mm": 123.0, **names, "force_x_n": -0.02, "force_y_n": 0.098})
    assert row["contact_antenna_vector_error_mm"] == pytest.approx(5.0)
    assert row["force_vector_error_n"] is None  # a component is missing
    assert row["contact_world_vector_error_mm"] is None


def test_a_wrong_sigma_of_a_vector_shows_in_the_component_that_has_it(
    random: np.random.Generator,
) -> None:
    places = {"x": 120.0, "y": 8.0, "z": 0.0}
    answers: list[dict[str, Any] | None] = []
    for _ in range(2000):
        answer = {"x_c_mm": 120.0}
        for axis, at in places.items():
            answer[f"contact_antenna_{axis}_mm"] = at + random.normal(0, 0.2)
            answer[f"contact_antenna_{axis}_sigma_mm"] = 0.05 if axis == "y" else 0.2
        answer |= {"force_y_n": 0.098 + random.normal(0, 1e-3), "force_y_sigma_n": 1e-3}
        answers.append(answer)
    found = summarise_method(scored([{}] * len(answers), answers))
    stated = found["calibration"]
    # The mean square of 2000 Gaussian numbers has a standard error of 0.03.
    for consistent in ("contact_antenna_x", "contact_antenna_z", "force_y"):
        assert stated[consistent]["nees"] == pytest.approx(1, abs=0.2)
        assert stated[consistent]["coverage_95"] == pytest.approx(0.95, abs=0.03)
    assert stated["contact_antenna_y"]["nees"] == pytest.approx(16, rel=0.2)
    assert stated["contact_antenna_y"]["coverage_95"] < 0.5
    assert stated["force_x"] is None  # nobody states it
    assert found["contact_antenna_rmse_mm"] == pytest.approx(0.2 * np.sqrt(3), rel=0.05)


@pytest.mark.parametrize("sigma", [0.0, -1.0, None, float("nan")])
def test_a_sigma_that_is_not_positive_states_nothing(sigma: float | None) -> None:
    rows = scored([{}], [{"x_c_mm": 121.0, "x_c_sigma_mm": sigma}])
    assert rows["x_c_error_in_sigmas"].to_list() == [None]
    found = summarise_method(rows)
    assert found["calibration"]["x_c"] is None
    assert found["consistent_rate"] is None


def test_a_sigma_that_is_absurdly_small_is_wrong_by_a_finite_ratio() -> None:
    answers: list[dict[str, Any] | None] = [{"x_c_mm": 121.0, "x_c_sigma_mm": 5e-324}] * 2
    rows = scored([{}, {"push_id": "other"}], answers)
    assert rows["x_c_error_in_sigmas"].to_list() == [LARGEST, LARGEST]
    stated = summarise_method(rows)["calibration"]["x_c"]
    assert (stated["coverage_95"], stated["nees"]) == (0, pytest.approx(LARGEST**2))
    figures = [value for row in strata_rows(rows) for value in row.values()]
    assert all(math.isfinite(value) for value in figures if isinstance(value, float))


@pytest.mark.parametrize("column", ["x_c_error_mm", "x_c_sigma_mm"])
def test_a_ratio_without_its_error_or_sigma_is_not_counted(column: str) -> None:
    rows = scored([{}], [{"x_c_mm": 121.0, "x_c_sigma_mm": 0.3}])
    without = rows.with_columns(pl.lit(None, pl.Float64).alias(column))
    assert calibration(without, SCORED_QUANTITIES[0]) is None


def test_stated_sigmas_are_held_against_errors(random: np.random.Generator) -> None:
    errors = random.normal(0, 0.3, 4000)

    def found(sigma: float) -> dict[str, float]:
        answers = [{"x_c_mm": 120 + error, "x_c_sigma_mm": sigma} for error in errors]
        calibration: dict[str, float] = summarise_method(scored([{}] * len(errors), list(answers)))[
            "calibration"
        ]["x_c"]
        return calibration

    consistent, bold = found(0.3), found(0.15)
    # 5.5 standard errors: of the shares 0.0034, 0.0008 and 0.0074, of the others 0.022 and 0.011.
    assert consistent["coverage_95"] == pytest.approx(0.95, abs=0.019)
    assert consistent["within_3_sigma"] == pytest.approx(0.9973, abs=0.0045)
    assert consistent["nees"] == pytest.approx(1, abs=0.123)
    assert consistent["sigma_over_rmse"] == pytest.approx(1, abs=0.062)
    assert bold["coverage_95"] == pytest.approx(0.673, abs=0.041)
    assert bold["nees"] == pytest.approx(4 * consistent["nees"])
    assert bold["sigma_over_rmse"] == pytest.approx(consistent["sigma_over_rmse"] / 2)


def test_leaving_a_frame_out_counts_as_half_the_beam_unless_a_refusal_is_right() -> None:
    hidden = {"visible_share": 0.1}  # "not identifiable" is right here
    true = [{}, {}, hidden, FREE]
    off = {"x_c_mm": 120.0 + 24.0}  # by a tenth of L
    refused = {"outcome": "not identifiable"}

    def both(answers: list[dict[str, Any] | None]) -> tuple[float, float]:
        found = summarise_method(scored(true, answers))
        return found["x_c_rmse_pct_L"], found["x_c_rmse_all_pct_L"]

    free = {"outcome": "no contact"}
    assert both([off, off, off, free]) == pytest.approx((10, 10))
    assert both([off, off, refused, free]) == pytest.approx((10, 10))
    assert both([off, off, refused, None]) == pytest.approx((10, 10))
    lacking = np.sqrt((10**2 + 50**2) / 2)
    assert both([off, None, refused, off]) == pytest.approx((10, lacking))
    assert both([off, refused, refused, free]) == pytest.approx((10, lacking))
    # A method of forces alone owes no distance; one that answers nothing owes everything.
    assert summarise_method(scored([{}], [{"force_n": 0.1}]))["x_c_rmse_all_pct_L"] is None
    assert summarise_method(scored([{}], [{"outcome": "crashed"}]))["x_c_rmse_all_pct_L"] == 50


def test_what_crashed_what_was_refused_and_what_was_missed_are_told_apart() -> None:
    contact = {"x_c_mm": 120.1, "x_c_sigma_mm": 0.1}
    rows = scored(
        [{}, {}, {}, {}, {}, FREE, FREE],
        [
            contact,
            {"x_c_mm": 130.0, "x_c_sigma_mm": 0.1},
            {"outcome": "not identifiable"},
            {"outcome": "no contact"},
            None,
            {"outcome": "no contact"},
            contact,
        ],
    )
    assert rows["failed"].to_list() == [False, False, True, True, True, False, True]
    assert rows["consistent"].to_list() == [True, False, False, False, False, True, False]
    found = summarise_method(rows)
    assert found["failure_rate"] == 4 / 7
    assert found["refused_rate"] == 2 / 7
    assert found["rightly_refused_rate"] == 0
    assert found["crashed_rate"] == 1 / 7
    assert found["consistent_rate"] == 2 / 7
    assert found["false_contact_rate"] == 1 / 2
    assert found["free_frames"] == 2
    assert found["detection_rate"] == 2 / 5
    assert found["outcomes"] == {
        "contact": 3,
        "no contact": 2,
        "not identifiable": 1,
        "crashed": 1,
    }
    assert sum(found["outcomes"].values()) == found["n"]


def test_rates_of_frames_that_are_not_there_are_null() -> None:
    touched = summarise_method(scored([{}], [{"x_c_mm": 120.0}]))
    assert touched["false_contact_rate"] is None
    free = summarise_method(scored([FREE], [{"outcome": "no contact", "x_c_mm": None}]))
    assert free["detection_rate"] is None
    assert (free["failure_rate"], free["consistent_rate"], free["x_c_rmse_pct_L"]) == (0, 1, None)


# The tip's shift, of one per cent of L, over what all 467 columns together err by.
PINHOLE_SNR_PER_PCT = 2.4 * (700 / 360) * np.sqrt(240 * 700 / 360) / 0.05
EDGE_ON = {"edge-on", "not identifiable"}


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("true", "right"),
    [
        ({}, set()),
        (FREE, {"no contact"}),
        ({"deflection_pct": 4.9 / PINHOLE_SNR_PER_PCT}, {"no contact", "not identifiable"}),
        ({"deflection_pct": 5.1 / PINHOLE_SNR_PER_PCT}, {"not identifiable"}),
        ({"deflection_pct": 61 / PINHOLE_SNR_PER_PCT}, set()),
        ({"visible_share": 0.2}, {"not identifiable"}),
        ({"visible_share": None}, set()),
        ({"second_s_c_mm": 190.0}, {"invalid", "not identifiable"}),
        ({"psi_deg": 60.0, "contact_antenna_mm": [120.0, 4.0, 6.9]}, set()),
        ({"psi_deg": 80.0, "contact_antenna_mm": [120.0, 1.4, 7.9]}, EDGE_ON),
        ({"psi_deg": -85.0, "contact_antenna_mm": [120.0, 0.7, -8.0]}, EDGE_ON),
    ],
)
def test_when_an_answer_without_numbers_is_right(true: dict[str, Any], right: set[str]) -> None:
    assert set(right_refusals(truth(true))["acceptable_outcomes"][0]) == right
    for outcome in Outcome:
        if outcome.has_values:
            continue
        row = one(true, {"outcome": str(outcome)})
        assert row["consistent"] == (str(outcome) in right)
        if row["true_x_c_mm"] is not None:
            assert row["failed"]
            assert row["rightly_refused"] == (str(outcome) in right)


@pytest.mark.parametrize(
    ("scene", "true", "assumption"),
    [
        ({"beam": {"tip_ratio": 0.97}}, {}, "taper"),
        ({"beam": {"tip_ratio": 0.97}}, {}, "taper or friction"),
        ({"object": {"friction": 0.1}}, {}, "friction"),
        ({"object": {"friction": 0.1}}, {}, "taper or friction"),
        ({"beam": {"bow_mm": 0.1}, "tolerances": {"bow_mm": 0.1}}, {}, "bow"),
        ({"beam": {"clamp_softness": 0.01}}, {}, "clamp"),
        ({"beam": {"length_mm": 239.0}, "tolerances": {"beam_length_mm": 0.1}}, {}, "length"),
        ({"clamp_offset_mm": [0.0, 3.0, 4.0]}, {}, "motor axis"),
        ({"object": {"drift_mm": [0.0, -0.5, 0.0]}}, {}, "resting object"),
        ({"camera": {"mount": "antenna", "knock_px": [0.0, 0.2]}}, {}, "camera at rest"),
        ({}, {"drawn.light_level": 1.5}, "light"),
        ({}, {"psi_deg": 20.0}, "plane"),
        ({}, {"psi_deg": 160.0}, "side"),
        ({}, {"second_s_c_mm": 190.0}, "one contact"),
    ],
)
def test_a_refusal_that_names_a_broken_assumption_is_right(
    scene: dict[str, Any], true: dict[str, Any], assumption: str
) -> None:
    def judged(scene: dict[str, Any], true: dict[str, Any], name: str | None) -> bool:
        world = truth(true)
        manifest = {**world.manifest, "scene": {**world.manifest["scene"], **scene}}
        refusal = pl.DataFrame(
            {"frame_id": "f0", "x_c_mm": None, "outcome": "invalid", "assumption": name}
        )
        table = checked_predictions(refusal, "mine")
        rows = score_frames(replace(world, manifest=manifest), table, "mine", "mine")
        assert rows["refused"].all()
        assert rows["assumption"].to_list() == [name]
        return bool(rows["rightly_refused"].item())

    assert judged(scene, true, assumption)
    assert not judged(scene, true, "gravity")
    assert not judged({}, {}, assumption)
    assert judged(scene, true, None) == (assumption == "one contact")


@pytest.mark.parametrize(("sigma_pct", "right"), [(0.9, True), (1.1, False)])
def test_a_taper_within_three_stated_sigmas_is_no_broken_assumption(
    sigma_pct: float, right: bool
) -> None:
    world = truth({})
    scene = {"beam": {"tip_ratio": 0.97}, "tolerances": {"tip_ratio_pct": sigma_pct}}
    manifest = {**world.manifest, "scene": {**world.manifest["scene"], **scene}}
    violated = right_refusals(replace(world, manifest=manifest))["violated"][0]
    assert ("taper" in violated) == right


def test_an_unknown_assumption_is_an_error() -> None:
    with pytest.raises(InputError, match="assumption 'haste' is unknown, allowed is one of taper"):
        one({}, {"outcome": "invalid", "assumption": "haste"})


def test_numbers_with_an_honest_sigma_are_right_where_a_refusal_would_be() -> None:
    weak = {"x_c_mm": 150.0, "x_c_sigma_mm": 40.0, "outcome": "weak contact"}
    row = one({"deflection_pct": 0.01}, weak)
    assert row["consistent"]
    assert not row["failed"]


def test_a_camera_beside_the_beam_looks_along_plane_c() -> None:
    true = truth({"psi_deg": 0.0})
    side = np.array([[1.0, 0, 0, -0.12], [0, 0, -1, 0], [0, 1, 0, 0.36], [0, 0, 0, 1]])
    rig = true.manifest["true_rig"]
    camera = {**rig["camera"], "camera_from_antenna": side.tolist()}
    beside = replace(true, manifest={**true.manifest, "true_rig": {**rig, "camera": camera}})
    assert right_refusals(true)["acceptable_outcomes"][0].is_empty()
    assert set(right_refusals(beside)["acceptable_outcomes"][0]) == EDGE_ON


def test_a_knocked_camera_may_be_refused() -> None:
    true = truth({})
    scene = true.manifest["scene"]
    for shift, allowed in ((0.0, set[str]()), (0.2, {"camera moved"})):
        camera = {**scene["camera"], "knock_px": [0.0, shift]}
        manifest = {**true.manifest, "scene": {**scene, "camera": camera}}
        found = right_refusals(replace(true, manifest=manifest))["acceptable_outcomes"][0]
        assert set(found) == allowed
