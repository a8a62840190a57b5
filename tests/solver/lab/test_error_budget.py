"""The error budget of a rig: what its sigmas add to those of an imagined push."""

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from solver.antenna import Antenna
from solver.instrument.observation import Observations
from solver.instrument.rig import Rig
from solver.instrument.rig_json import rig_to_json, sigma_keys, without_errors
from solver.lab.check import calibration_report
from solver.lab.error_budget import BOW, IMAGE, ErrorBudget, error_budget
from solver.methods.exact_fit import exact_fit
from solver.tracker import PushTracker

RIGIDITY, LENGTH = "beam.flexural_rigidity_sigma_n_mm2", "beam.length_sigma_mm"


def with_rigidity_sigma(antenna: Antenna, relative: float) -> Antenna:
    rig = antenna.rig
    sigma = relative * rig.beam.flexural_rigidity
    tolerances = replace(rig.tolerances, flexural_rigidity=sigma)
    return replace(antenna, rig=replace(rig, tolerances=tolerances))


def budget_of(antenna: Antenna) -> ErrorBudget:
    budget = error_budget(antenna)
    assert budget is not None
    return budget


def test_the_error_of_ei_is_all_that_a_force_lacks(antenna: Antenna) -> None:
    budget = budget_of(with_rigidity_sigma(antenna, 0.2))
    assert budget.force_sigma_pct == pytest.approx(20, rel=0.01)
    first = budget.shares[0]
    assert first.source == RIGIDITY
    assert first.of_force == pytest.approx(1, abs=0.01)
    assert first.of_x_c == pytest.approx(0, abs=1e-6)


def test_without_all_other_errors_that_of_the_image_is_left(antenna: Antenna) -> None:
    bare = replace(
        antenna,
        rig=without_errors(antenna.rig, sigma_keys(antenna.rig)),
        at_rest=replace(antenna.at_rest, line=antenna.rest.without_bow()),
        clamp_sigma=0.0,
        scale_sigma=0.0,
    )
    (only,) = budget_of(bare).shares
    assert only.source == IMAGE
    assert only.of_x_c == pytest.approx(1)
    assert only.of_force == pytest.approx(1)
    # Errors of the images grow with the points'; the light that an object reflects stays.
    at_rest, line = bare.at_rest, bare.rest
    line = replace(line, covariance=4 * line.covariance)
    coarse = replace(bare, at_rest=replace(at_rest, line=line, sigma_px=2 * at_rest.sigma_px))
    ratio = budget_of(coarse).x_c_sigma_mm / budget_of(bare).x_c_sigma_mm
    assert 1.3 < ratio < 2.01


def test_a_bow_that_is_not_known_is_named(antenna: Antenna) -> None:
    covariance = antenna.rest.covariance + np.diag([0, 0, 1e-3, 0, 0]) ** 2
    line = replace(antenna.rest, covariance=covariance)
    bowed = replace(antenna, at_rest=replace(antenna.at_rest, line=line))
    assert budget_of(bowed).shares[0].source == BOW


def test_the_imagined_push_has_the_sigma_of_a_real_one(
    antenna: Antenna, observations: Observations
) -> None:
    tracker, length = PushTracker(antenna, exact_fit), antenna.rig.beam.length
    ratios = []
    for frame in observations.frames:
        estimate = tracker.solve(frame.image(), frame.readings, frame.push_id).estimate
        if not estimate.values:
            continue
        # Sigma of x_c is inversely proportional to the force that bends the beam, to first order.
        force = estimate.values["force_n"] / antenna.rig.beam.flexural_rigidity * length**2
        ratios.append(estimate.sigma("x_c_m") * force)
    assert ratios
    unit = 6 * 0.1 / (0.6**2 * (3 - 0.6))  # of a cantilever whose tip is deflected by a tenth
    expected = budget_of(antenna).x_c_sigma_mm * 1e-3 * unit
    assert min(ratios) / 3 < expected < 3 * max(ratios)


def test_the_report_has_the_budget(antenna: Antenna) -> None:
    report = calibration_report(with_rigidity_sigma(antenna, 0.2))
    assert f"100%  {RIGIDITY}" in report.text()
    shares = json.loads(report.json())["budget"]["shares"]
    assert shares[0]["source"] == RIGIDITY
    assert shares[0]["of_force"] > 0.99


def _values(rig: Rig) -> dict[str, Any]:
    document = json.loads(rig_to_json(rig))
    return {f"{section}.{name}": v for section in document for name, v in document[section].items()}


def test_each_key_of_an_error_is_set_to_zero_alone(antenna: Antenna) -> None:
    before = _values(antenna.rig)
    keys = sigma_keys(antenna.rig)
    assert {RIGIDITY, LENGTH, "beam_shape.bow_sigma_mm"} <= set(keys)
    for key in keys:
        after = _values(without_errors(antenna.rig, [key]))
        assert not np.any(after.pop(key, 0.0))
        assert after == {name: value for name, value in before.items() if name != key}
