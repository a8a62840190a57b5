"""The public names of the package, used as its own documentation shows them."""

import doctest
import itertools
import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import solver
from solver.instrument import estimate as estimates


def test_a_rig_is_opened_and_its_frames_are_tracked(dataset: Path) -> None:
    observations = solver.open_observations(str(dataset / "observations"))
    rig = solver.open_rig(str(dataset / "observations"))
    tracker = rig.tracker("exact_fit")
    frame = next(iter(observations))
    assert frame.readings.motor_angle is not None
    angle = math.degrees(frame.readings.motor_angle)
    estimate = tracker.update(frame.image(), motor_angle_deg=angle, push_id=frame.push_id)
    assert estimate.outcome is solver.Outcome.CONTACT
    assert estimate.x_c_mm is not None
    assert estimate.x_c_mm == pytest.approx(1e3 * estimate.values["x_c_m"], rel=1e-12)
    assert estimate.sigma("x_c_mm") == pytest.approx(1e3 * estimate.sigma("x_c_m"), rel=1e-12)
    same = rig.tracker(solver.METHODS["exact_fit"]).solve(
        frame.image(), frame.readings, frame.push_id
    )
    assert same.estimate.values == estimate.values
    # A colour image of equal channels is the gray one.
    colour = np.repeat(frame.image()[:, :, None], 3, axis=2)
    again = rig.tracker().update(colour, motor_angle_deg=angle)
    assert again.x_c_mm == pytest.approx(estimate.x_c_mm, abs=1e-9)
    assert not rig.check().findings


def test_what_cannot_be_used_is_an_outcome_or_a_sentence(dataset: Path) -> None:
    rig = solver.open_rig(dataset / "observations")
    wrong = rig.tracker().update(np.zeros((3, 4, 7)))
    assert wrong.outcome is solver.Outcome.INVALID
    assert "allowed are gray or colour" in repr(wrong)
    with pytest.raises(solver.InputError, match="method 'exact' is unknown, allowed is one of"):
        rig.tracker("exact")
    with pytest.raises(solver.InputError, match="centreline 'x' is unknown"):
        solver.open_rig(dataset / "observations", centreline="x")


def test_an_estimate_has_its_quantities_as_attributes() -> None:
    estimate = solver.Estimate(
        solver.Outcome.CONTACT,
        values={"x_c_m": 0.12, "psi_rad": 0.1, "compliance_m_per_n": 2e-3},
        covariance=np.diag([1e-8, 1e-4, 1e-8]),
    )
    assert estimate.psi_deg == pytest.approx(math.degrees(0.1))
    assert estimate.force_n is None
    assert estimate.sigma("psi_deg") == pytest.approx(math.degrees(0.01))
    text = "Estimate(contact: x_c 120 +- 0.1 mm, psi 5.72958 +- 0.57 deg, 1/k_s 2 +- 0.1 mm/N)"
    assert repr(estimate) == text
    with pytest.raises(AttributeError, match="no 'x_c_cm', but x_c_mm"):
        _ = estimate.x_c_cm
    with pytest.raises(ValueError, match="has no force_n, but x_c_m, psi_rad"):
        estimate.sigma("force_n")


def test_frames_come_push_by_push_and_step_by_step(dataset: Path) -> None:
    observations = solver.open_observations(dataset / "observations")
    steps = [(frame.push_id, frame.step) for frame in observations]
    assert len(steps) == len(observations.frames)
    for (push, step), (next_push, next_step) in itertools.pairwise(steps):
        assert push != next_push or step < next_step


def test_the_examples_of_the_documentation_run() -> None:
    for module in (solver, estimates):
        failed, tried = doctest.testmod(module, extraglobs=vars(estimates))
        assert tried
        assert not failed


def test_importing_the_package_imports_nothing_heavy_and_sets_no_variable() -> None:
    code = """
import os, sys
before = dict(os.environ)
import solver
assert dir(solver)
heavy = {"numba", "scipy", "cv2", "numpy", "typer"} & set(sys.modules)
assert not heavy, heavy
solver.METHODS["exact_fit"]
assert not {name for name in os.environ if name.startswith("NUMBA")} - set(before)
"""
    subprocess.run([sys.executable, "-c", code], check=True)
