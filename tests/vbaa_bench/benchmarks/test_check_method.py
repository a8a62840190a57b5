"""Mistakes in a method of the user's own are recognised on a dozen frames."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

from solver.instrument.errors import InputError
from solver.instrument.estimate import Estimate, Outcome
from tests.draws import generator
from tests.vbaa_bench.scoring.worlds import FREE, truth
from vbaa_bench.benchmarks import check_method as module
from vbaa_bench.benchmarks.check_method import FRAMES, Finding, check_method, compare
from vbaa_bench.scene.load import load_scene
from vbaa_bench.scoring.isolation.runs import MethodRun
from vbaa_bench.scoring.isolation.worker import estimate_faults
from vbaa_bench.scoring.predictions import checked_predictions

PLACES = (60.0, 90.0, 110.0, 150.0, 180.0, 210.0)
RUN = MethodRun(Path("first.csv"), len(PLACES), 0, "")


def world() -> list[dict[str, Any]]:
    return [
        {
            "x_c_mm": x,
            "force_n": 10 / x,
            "psi_deg": 20.0,
            "theta_c_deg": x / 10,
            "contact_antenna_mm": [x, 8.0, 3.0],
        }
        for x in PLACES
    ]


def answers(**factors: float) -> pl.DataFrame:
    """Estimates with errors of 1 %, each times a factor."""
    errors = 1 + 0.01 * generator(__name__, 0).normal(size=len(PLACES))
    rows = []
    for i, (error, row) in enumerate(zip(errors, world(), strict=True)):
        estimates = {name: row[name] * error for name in ("x_c_mm", "force_n", "psi_deg")}
        estimates["contact_antenna_y_mm"] = 8.0 * error
        scaled = {name: factors.get(name, 1.0) * value for name, value in estimates.items()}
        rows.append({"frame_id": f"f{i}", "image_ms": 2.0 + i, **scaled})
    return checked_predictions(pl.DataFrame(rows), "mine")


def findings(table: pl.DataFrame, *more: dict[str, Any], run: MethodRun = RUN) -> list[Finding]:
    return compare(truth(*world(), *more), run, table, table)


def wrong(table: pl.DataFrame) -> list[str]:
    return [finding.sentence for finding in findings(table) if finding.status == "wrong"]


def test_nothing_is_wrong_with_a_good_method() -> None:
    lines = findings(answers())
    assert {finding.status for finding in lines} == {"ok"}
    assert any("100,000 frames take 7.5 minutes" in finding.sentence for finding in lines)


@pytest.mark.parametrize(
    ("column", "factor", "mistake"),
    [
        ("x_c_mm", 1000, "in mm instead of m"),
        ("x_c_mm", 100, "in cm instead of m"),
        ("x_c_mm", -1, "sign is reversed; x points from the clamp to the tip"),
        ("psi_deg", 180 / np.pi, "in degrees instead of radians"),
        ("psi_deg", -1, "sign is reversed; psi is positive"),
        ("force_n", 1000, "in mN instead of N"),
        ("force_n", 1 / 9.81, "in kgf instead of N"),
        ("force_n", 1e6, "is it in the unit"),
        ("contact_antenna_y_mm", -1, "sign is reversed; see the frames"),
    ],
)
def test_units_and_signs(column: str, factor: float, mistake: str) -> None:
    (sentence,) = wrong(answers(**{column: factor}))
    assert sentence.startswith(column)
    assert mistake in sentence


def test_a_poor_method_is_not_a_wrong_unit() -> None:
    assert wrong(answers(x_c_mm=0.5, force_n=2.5)) == []


def test_contact_distances_from_the_tip() -> None:
    table = answers().with_columns(x_c_mm=240 - pl.col("x_c_mm"))
    assert wrong(table) == ["x_c_m is measured from the tip; measure it from the clamp"]


def test_missing_values_and_crashes_are_counted() -> None:
    table = answers()
    holes = table.with_columns(
        force_n=pl.when(pl.int_range(pl.len()) > 1).then("force_n"),
        outcome=pl.when(pl.col("frame_id") == "f5").then(pl.lit("crashed")).otherwise("outcome"),
        message=pl.lit("ValueError: an estimate holds a value that is not finite"),
    )
    assert wrong(holes) == [
        "1 of 6 frames crashed: ValueError: an estimate holds a value that is not finite",
        "force_n is missing in 2 of 5 answered frames, which count as failures",
    ]
    neither = table.with_columns(x_c_mm=None, force_n=None)
    assert "neither x_c_m nor force_n is estimated, one is required" in wrong(neither)


def test_contacts_without_contact_and_sigmas_in_other_units_are_noted() -> None:
    free = {"frame_id": "f6", "x_c_mm": 100.0, "force_n": 1.0, "outcome": "contact"}
    table = answers().with_columns(x_c_sigma_mm=pl.lit(1e-3))
    table = pl.concat([table, checked_predictions(pl.DataFrame([free]), "")])
    notes = [finding.sentence for finding in findings(table, FREE) if finding.status == "note"]
    assert notes[0].startswith("1 of 1 frames without contact are answered with a contact")
    ratio = re.match(r"the RMS error of x_c_mm is (\S+) stated sigmas", notes[1])
    assert ratio is not None
    assert float(ratio[1]) > 20
    assert len(notes) == 2


def test_covariances_that_no_correct_method_states() -> None:
    def faults(covariance: Any) -> list[str]:
        values = {"x_c_m": 0.1, "force_n": 0.2}
        return estimate_faults(Estimate(Outcome.CONTACT, "", values, np.array(covariance)))

    assert faults([[1e-8, 0], [0, 1e-6]]) == []
    assert faults([[1e-8, 1e-7], [1e-7, 1e-6]]) == []  # singular: one is derived from the other
    assert faults([[1e-8, 2e-7], [2e-7, 1e-6]]) == ["the covariance is not positive definite"]
    assert faults([[1e-8, 2e-8], [0, 1e-6]]) == ["the covariance is not symmetric"]
    assert faults([[0, 0], [0, 1]]) == ["the covariance has no positive variance for x_c_m"]
    assert estimate_faults(3.0) == []
    run = MethodRun(Path(), 6, 0, "", faults={"the covariance is not symmetric": 4})
    first = findings(answers(), run=run)[0]
    assert first == Finding("wrong", "the covariance is not symmetric (4 frames)")


METHODS = """
import itertools, random
from solver import Estimate, Outcome
from solver.methods import METHODS

def restless(measurement):
    values = {"x_c_m": random.random()}
    return Estimate(Outcome.CONTACT, values=values, covariance=[[-1.0]])
restless.information = "planar"

def of_no_type(measurement):
    return 0.12
of_no_type.information = "everything"
"""


@pytest.mark.thorough
def test_a_method_runs_twice_in_its_own_processes(
    dataset: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "mine.py").write_text(METHODS, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    lines = check_method("mine:restless", dataset, 8)
    wrong = [finding.sentence for finding in lines if finding.status == "wrong"]
    assert wrong[0] == "the covariance has no positive variance for x_c_m (4 frames)"
    assert wrong[1].startswith("a second run gives other results for the same frames: x_c_mm;")
    with pytest.raises(InputError, match="information 'everything' is unknown"):
        check_method("mine:of_no_type", dataset, 8)


def test_the_built_in_scene_has_the_frames_of_a_check(tmp_path: Path) -> None:
    path = tmp_path / "scene.yaml"
    path.write_text(module.SCENE, encoding="utf-8")
    pushes = load_scene(path).scene.pushes
    assert pushes is not None
    assert len(pushes.contact_distance_mm or ()) * len(pushes.pushing_angle_deg or ()) == FRAMES
