"""The public names of the package, used as its own documentation shows them."""

import doctest
import itertools
import json
import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import solver
from solver.centreline.extractors import EXTRACTORS
from solver.instrument import estimate as estimates
from solver.instrument.observation import Observations
from solver.methods import LEARNING


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
    # The contact of an overlay is on the beam, where the object hides its points.
    contact = rig.contact_in_image(same)
    assert contact is not None
    assert same.line is not None
    u, v = same.line.points.T
    assert np.interp(contact.point[0], u, v) == pytest.approx(contact.point[1], abs=0.5)
    assert np.hypot(*contact.direction) == pytest.approx(1.0)
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


def test_the_examples_of_the_documentation_run(
    dataset: Path,
    observations: Observations,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    failed, tried = doctest.testmod(estimates, extraglobs=vars(estimates))
    assert tried
    assert not failed
    page = Path(solver.__file__).with_name("README.md").read_text(encoding="utf-8")
    code = page.split("```python")[1].split("```")[0]
    (tmp_path / "rig").symlink_to(dataset / "observations")
    monkeypatch.chdir(tmp_path)
    exec(code, {"image": observations.frames[0].image()})
    *_, estimate = capsys.readouterr().out.splitlines()
    assert estimate.startswith("Estimate(contact: x_c ")


@pytest.mark.thorough
def test_importing_the_package_imports_nothing_heavy_and_sets_one_variable() -> None:
    code = """
import os, sys
before = dict(os.environ)
import solver
assert set(solver.__all__) <= set(dir(solver))
heavy = {"numba", "scipy", "cv2", "numpy", "typer"}
assert not heavy & set(sys.modules), heavy & set(sys.modules)
solver.METHODS["exact_fit"]
assert "numba" in sys.modules
changed = {name for name, value in os.environ.items() if before.get(name) != value}
assert changed == {"OPENCV_IO_MAX_IMAGE_PIXELS"}, changed
"""
    # Not the environment of this process, which has imported the package.
    environment = {"PYTHONPATH": str(Path(solver.__file__).parents[1])}
    subprocess.run([sys.executable, "-c", code], check=True, env=environment)


# Rigs without the sensor, or without the direction of gravity, that these methods need.
REFUSED = {"moment_sensor", "force_sensor", "hung_weight"}


@pytest.fixture(scope="module", params=EXTRACTORS)
def rig(request: pytest.FixtureRequest, dataset: Path) -> solver.CalibratedRig:
    return solver.open_rig(dataset / "observations", centreline=request.param)


def test_each_centreline_can_be_checked(rig: solver.CalibratedRig) -> None:
    report = rig.check()
    found = json.loads(report.json())
    assert found["noise_dark"] + found["noise_per_gray"] > 0
    assert found["pixel_mm"] == pytest.approx(0.51, rel=0.05)
    assert report.meaning in report.text()
    learned = rig.antenna.extract.detector is not None
    appearance = [found[name] for name in ("beam", "width_px", "spread_px", "roughness_px")]
    assert [value is not None for value in appearance] == [learned] * 4
    assert ("not learned by this centreline" in report.text()) == (not learned)
    assert found["beam"] in ("bright", None)


@pytest.mark.thorough
@pytest.mark.parametrize("name", solver.METHODS)
def test_each_method_tracks_with_each_centreline(
    rig: solver.CalibratedRig, observations: Observations, name: str
) -> None:
    method = solver.METHODS[name]
    if name in LEARNING:
        for unlearned in (name, method):
            with pytest.raises(solver.InputError, match=r"use rig\.learn\(frames\)\.tracker"):
                rig.tracker(unlearned)
        rig = rig.learn(observations.frames)
        assert rig.beam is not None
        assert rig.antenna.rig.shape is rig.beam.shape
    frame = observations.frames[0]
    angle = math.degrees(frame.readings.motor_angle or 0.0)
    estimate = rig.tracker(name).update(frame.image(), motor_angle_deg=angle)
    if name in REFUSED:
        assert estimate.outcome is solver.Outcome.INVALID
        assert estimate.message
        return
    assert estimate.outcome is solver.Outcome.CONTACT
    # The truth is 100 or 200 mm; linear theory errs by millimetres.
    assert estimate.x_c_mm is not None
    assert min(abs(estimate.x_c_mm - place) for place in (100, 200)) < 15
