"""Error amplification, condition and rounding of the methods, each found by another road."""

import json
import sys
from collections.abc import Callable
from dataclasses import replace
from math import inf
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from results.mechanics.reference import BEAM
from solver.instrument.estimate import Estimate, Outcome
from solver.instrument.measurement import Measurement
from solver.methods import METHODS
from vbaa_bench import cli
from vbaa_bench.benchmarks import stability
from vbaa_bench.benchmarks.stability import (
    DEFLECTIONS,
    PIXEL,
    SIGMA_PX,
    amplification,
    assess_method,
    condition,
    measure,
    rounding,
    rows,
    simulate_push,
)

LENGTH = BEAM.length


@pytest.fixture(scope="module")
def record() -> stability.Record:
    # A method is repeated for every stretch: 20 of them have the same amplification to 1.5 %.
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(stability, "STRETCHES", 20)
        return measure(METHODS, contacts=(0.5,))


def by_row(row: int) -> Callable[[Measurement], Estimate]:
    """A method whose contact is the y of one column, and its force the mean of all, as newtons."""

    def method(measurement: Measurement) -> Estimate:
        y = measurement.points[:, 1]
        values = {"x_c_m": float(y[row]), "force_n": float(y.mean())}
        return Estimate(Outcome.CONTACT, values=values, covariance=np.diag([4.0, 9.0]), chi2=0.0)

    return method


def test_a_linear_method_is_amplified_as_its_derivative_says() -> None:
    measurement = simulate_push(BEAM, 0.12, 0.1)
    count = len(measurement.points)
    plain = by_row(5)(measurement)
    x_c, force = amplification(by_row(5), measurement, plain) or (inf, inf)
    # One column that errs alone is all that it errs; a stretch is taken to share it evenly.
    stretch = len(np.array_split(np.arange(count), stability.STRETCHES)[0])
    assert x_c == pytest.approx(stretch**-0.5)
    assert force == pytest.approx(count**-0.5)
    ulp = rounding(by_row(5), measurement, plain)
    assert ulp == pytest.approx(np.spacing(measurement.points[5, 1]) / LENGTH, rel=1e-6)
    assert condition(plain) == pytest.approx(1.0)


def test_the_condition_is_that_of_the_correlation() -> None:
    def correlated(by: float, unit: float) -> Estimate:
        covariance = np.array([[1.0, by * unit], [by * unit, unit**2]])
        values = {"x_c_m": 0.1, "force_n": 1.0}
        return Estimate(Outcome.CONTACT, values=values, covariance=covariance, chi2=1.0)

    for unit in (1.0, 1e-6):
        assert condition(correlated(-0.997, unit)) == pytest.approx(1.997 / 0.003)


@pytest.mark.parametrize("name", ["exact_fit", "linear_fit"])
@pytest.mark.parametrize("deflection", DEFLECTIONS)
def test_amplification_is_what_a_fit_states(name: str, deflection: float) -> None:
    measurement = simulate_push(BEAM, 0.5 * LENGTH, deflection)
    plain = METHODS[name](measurement)
    found = amplification(METHODS[name], measurement, plain)
    assert found is not None
    stated = plain.sigma("x_c_m"), plain.sigma("force_n")
    # Linear theory on a beam that is not linear leaves a misfit, by which its sigmas are widened.
    widest = 1.03 if name == "exact_fit" else 100.0
    for out, sigma in zip(found, stated, strict=True):
        assert 0.97 < sigma / (out * SIGMA_PX * PIXEL) < widest


@pytest.mark.thorough
@pytest.mark.parametrize("name", ["two_point", "exact_fit"])
def test_amplification_is_the_scatter_of_noisy_frames(
    name: str, random: np.random.Generator
) -> None:
    measurement = simulate_push(BEAM, 0.5 * LENGTH, 0.2)
    found = assess_method(METHODS[name], measurement)
    x_c = []
    for _ in range(100):
        noise = SIGMA_PX * PIXEL * random.standard_normal(len(measurement.points))
        points = measurement.points + np.outer(noise, [0.0, 1.0])
        view = replace(measurement.view, points=points)
        x_c.append(METHODS[name](replace(measurement, view=view)).values["x_c_m"])
    scatter = 100 * float(np.std(x_c)) / LENGTH / SIGMA_PX
    assert found["x_c_pct_L_per_px"] == pytest.approx(scatter, rel=0.5)  # 7 to 10 % by chance


@pytest.mark.thorough
def test_every_method_has_its_numbers(record: stability.Record) -> None:
    assert set(record["methods"]) == set(METHODS)
    json.dumps(record, allow_nan=False)
    for name, cases in record["methods"].items():
        assert [case["deflection"] for case in cases] == list(DEFLECTIONS)
        for case in cases:
            if name == "three_point" and case["outcome"] == Outcome.NOT_IDENTIFIABLE:
                assert case["x_c_pct_L_per_px"] is None
                continue
            assert case["rounding"] < 1e-9
    exact, paper = record["methods"]["exact_fit"], record["methods"]["two_point"]
    # Cramer and Rao: 8.5 sigma / (y_tip sqrt(columns)), of a contact in the middle.
    for case in exact:
        limit = 100 * 8.5 * PIXEL / (case["deflection"] * LENGTH) / np.sqrt(LENGTH / PIXEL)
        assert case["x_c_pct_L_per_px"] == pytest.approx(limit, rel=0.1)
        assert 500 < case["condition"] < 5000
    for ours, theirs in zip(exact, paper, strict=True):
        assert theirs["x_c_pct_L_per_px"] > 5 * ours["x_c_pct_L_per_px"]
        assert theirs["condition"] is None
    # It does not look at points.
    assert {case["x_c_pct_L_per_px"] for case in record["methods"]["force_sensor"]} == {0.0}


def test_an_answer_that_is_lost_has_no_amplification() -> None:
    measurement = simulate_push(BEAM, 0.12, 0.1)

    def brittle(given: Measurement) -> Estimate:
        if not np.array_equal(given.points, measurement.points):
            return Estimate(Outcome.INVALID, "moved")
        return by_row(0)(given)

    found = assess_method(brittle, measurement)
    assert found["outcome"] == "contact"
    assert found["x_c_pct_L_per_px"] is found["rounding"] is None
    assert (
        assess_method(lambda _given: Estimate(Outcome.NO_CONTACT), measurement)["rounding"] is None
    )


@pytest.mark.thorough
def test_the_command_prints_a_table_or_json(
    record: stability.Record, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(stability, "measure", lambda _methods: record)
    words = ["check-method", "all", "--stability"]
    done = CliRunner().invoke(cli.app, [*words, "--json"])
    assert done.exit_code == 0, done.output
    assert json.loads(done.stdout) == record
    shown = CliRunner().invoke(cli.app, words, env={"COLUMNS": "80"})
    assert shown.exit_code == 0, shown.output
    for name in METHODS:
        assert name in shown.stdout
    assert len(rows(record)) == 2 * len(METHODS)
    (tmp_path / "mine.py").write_text("def solve(measurement): ...\n", encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path])
    monkeypatch.setattr(stability, "measure", lambda methods: {"methods": dict.fromkeys(methods)})
    own = CliRunner().invoke(cli.app, ["check-method", "mine:solve", "--stability", "--json"])
    assert json.loads(own.stdout) == {"methods": {"mine:solve": None}}
    refused = CliRunner().invoke(cli.app, ["check-method", "all", "runs/set", "--stability"])
    assert str(refused.exception) == "--stability needs no dataset: its points are simulated"
    unknown = CliRunner().invoke(cli.app, ["check-method", "magic", "--stability"])
    assert "method 'magic' is unknown" in str(unknown.exception)
