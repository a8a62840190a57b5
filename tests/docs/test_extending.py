"""The page on extensions: its files run, and answer rightly where the package alone does not."""

import importlib
import math
import re
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Final, NamedTuple

import numpy as np
import pytest
from scipy.integrate import solve_bvp
from scipy.optimize import fsolve

from solver.centreline.extractors import find_extractor
from solver.instrument.arrays import Floats
from solver.instrument.beam_shape import stated_shape
from solver.instrument.errors import InputError
from solver.instrument.estimate import Estimate
from solver.instrument.measurement import Measurement
from solver.methods.by_name import find_method, with_beam
from solver.methods.exact_fit import exact_fit
from solver.methods.push_fit import push_fit
from tests.beam_images import Look, Sensor, bent, distances, drawn, guide
from tests.consistency import MOST_SIGMAS
from tests.draws import generator
from tests.simulated import BEAM, columns, measurement, pushed_points
from tests.tapered import SIGMA, bowed

PAGE: Final = (Path(__file__).parents[2] / "docs" / "extending.md").read_text(encoding="utf-8")
FILES: Final = ("heavy_tip", "tall_rows", "linear_beam", "bright_ridge")
# The weight at the tip, over EI / L^2: within the prior of the page.
WEIGHT: Final = 0.106


@pytest.fixture
def modules(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[dict[str, ModuleType]]:
    for name, text in zip(FILES, re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL), strict=True):
        (tmp_path / f"{name}.py").write_text(text, encoding="utf-8")
    monkeypatch.syspath_prepend(str(tmp_path))
    yield {name: importlib.import_module(name) for name in FILES}
    for name in FILES:
        del sys.modules[name]


class Shape(NamedTuple):
    """Centreline (m, 2), and the contact's place (2,) and tangent's angle; over the length."""

    line: Floats
    contact: Floats
    angle: float


def heavy(force: float, place: float, motor_angle: float) -> Shape:
    """A straight beam with a weight at its tip, under a normal force [EI / L^2] at a place.

    Boundary value problem: theta' = M, M' = -t x R, with the forces R beyond a section.
    """
    down = math.radians(-90) - motor_angle
    weight = WEIGHT * np.array([math.cos(down), math.sin(down)])
    spans = np.array([place, 1 - place])[:, None]

    def rates(t: Floats, state: Floats, parameters: Floats) -> Floats:
        del t
        theta, moment = state[:2], state[2:4]
        normal = np.array([-math.sin(parameters[0]), math.cos(parameters[0])])
        loads = np.array([weight + force * normal, weight])
        across = np.cos(theta) * loads[:, 1:] - np.sin(theta) * loads[:, :1]
        return np.vstack([spans * one for one in (moment, -across, np.cos(theta), np.sin(theta))])

    def ends(start: Floats, end: Floats, parameters: Floats) -> Floats:
        joints = end[0::2] - start[1::2]
        return np.array([start[0], start[4], start[6], end[3], end[0] - parameters[0], *joints])

    t = np.linspace(0, 1, 40)
    solution = solve_bvp(rates, ends, t, np.zeros((8, 40)), p=[0.1], tol=1e-9, max_nodes=10**5)
    assert solution.success
    state = solution.sol(np.linspace(0, 1, 1001))
    line = np.vstack([state[[4, 6]].T, state[[5, 7]].T[1:]])
    return Shape(line, line[1000], float(solution.p[0]))


def taken(shape: Shape, motor_angle: float, random: np.random.Generator) -> Measurement:
    """Columns of a shape, on a rig whose images at rest show the bow by the weight."""
    rest = BEAM.length * heavy(0.0, 0.5, 0.0).line
    powers = np.arange(2, 5)
    arcs = np.append(0.0, np.hypot(*np.diff(rest, axis=0).T).cumsum()) / BEAM.length
    bow = np.asarray(np.linalg.lstsq(arcs[:, None] ** powers, rest[:, 1])[0], np.float64)
    line = BEAM.length * shape.line
    points = columns(np.column_stack([np.zeros(len(line)), line, np.zeros(len(line))]))
    sag = (points[:, :1] / BEAM.length) ** powers @ bow
    removed = np.column_stack([np.zeros(len(points)), sag])
    points[:, 1] += SIGMA * random.standard_normal(len(points))
    one = bowed(points, removed, bow, np.zeros(3), stated_shape(0.005, 0.0, 0.0, 0.0))
    return replace(one, motor_angle=motor_angle)


def error(estimate: Estimate, name: str, truth: float) -> float:
    """The error of a value in sigmas."""
    return (estimate.values[name] - truth) / estimate.sigma(name)


@pytest.mark.parametrize("motor_angle", [0.0, -0.6])
def test_a_beam_with_a_heavy_tip_is_answered(
    modules: dict[str, ModuleType], motor_angle: float
) -> None:
    force, place = 0.9, 0.6
    shape = heavy(force, place, motor_angle)
    frame = taken(shape, motor_angle, generator(__name__, 1))
    estimate = modules["heavy_tip"].exact_fit_heavy(frame)
    assert estimate.values, estimate
    unit = BEAM.flexural_rigidity / BEAM.length**2
    assert abs(error(estimate, "x_c_m", BEAM.length * shape.contact[0])) < MOST_SIGMAS
    assert abs(error(estimate, "force_n", force * unit)) < MOST_SIGMAS
    assert estimate.sigma("x_c_m") < 0.01 * BEAM.length
    weight = estimate.parameters["tip_load"]
    assert abs(weight.value - WEIGHT) < MOST_SIGMAS * weight.sigma
    assert 0 < weight.sigma < 0.02  # of the prior 0.01, times the inflation by unlucky residuals
    alone = exact_fit(frame)
    if motor_angle and alone.values:  # the weight's moment has changed since the images at rest
        assert abs(error(alone, "x_c_m", BEAM.length * shape.contact[0])) > 4


def test_a_push_of_a_beam_with_a_heavy_tip_is_answered(modules: dict[str, ModuleType]) -> None:
    """A rigid edge at rest, which the beam's axis touches at 0.6 of the length."""
    random, angles = generator(__name__, 2), (0.1, 0.2, 0.3)
    radius = BEAM.radius / BEAM.length
    first = heavy(0.0, 0.6, 0.0)
    normal = np.array([-math.sin(first.angle), math.cos(first.angle)])
    edge = first.contact - radius * normal

    def apart(unknown: Floats, pushed: float) -> Floats:
        shape = heavy(unknown[0], unknown[1], -pushed)
        side = np.array([-math.sin(shape.angle), math.cos(shape.angle)])
        turn = np.array(
            [[math.cos(pushed), -math.sin(pushed)], [math.sin(pushed), math.cos(pushed)]]
        )
        return shape.contact - radius * side - turn @ edge

    frames, unknown = [], np.array([0.5, 0.6])
    for pushed in angles:
        unknown = fsolve(apart, unknown, args=(pushed,))
        frames.append(taken(heavy(unknown[0], unknown[1], -pushed), -pushed, random))
    tolerances = replace(frames[0].rig.tolerances, encoder=1e-4)
    rig = replace(frames[0].rig, tolerances=tolerances)
    *earlier, last = (replace(frame, rig=rig) for frame in frames)
    last = replace(last, earlier=tuple(earlier))
    estimate = modules["heavy_tip"].push_fit_heavy(last)
    assert estimate.values, estimate
    assert "compliance_m_per_n" in estimate.values, estimate.message
    assert abs(error(estimate, "compliance_m_per_n", 0.0)) < MOST_SIGMAS
    truth = heavy(unknown[0], unknown[1], -angles[-1])
    assert abs(error(estimate, "x_c_m", BEAM.length * truth.contact[0])) < MOST_SIGMAS
    assert estimate.sigma("x_c_m") < 0.003 * BEAM.length
    weight = estimate.parameters["tip_load"]
    assert abs(weight.value - WEIGHT) < MOST_SIGMAS * weight.sigma
    # Together with an error of the page, which all frames share.
    both = push_fit(
        last.with_shared_errors(modules["tall_rows"].taller), beam=modules["heavy_tip"].heavy_tip
    )
    assert both.values, both
    assert both.sigma("x_c_m") > estimate.sigma("x_c_m")


def test_an_error_of_the_page_is_in_the_covariance(modules: dict[str, ModuleType]) -> None:
    points, x_c, force = pushed_points(0.12, 0.1)
    points = points * [1.0, 1.002]  # two sigmas
    frame = measurement(points, SIGMA, base_sigma=2e-6)
    estimate = modules["tall_rows"].exact_fit_tall_rows(frame)
    assert abs(error(estimate, "force_n", force)) < 2.5
    assert abs(error(estimate, "x_c_m", x_c)) < 2.5
    assert abs(error(exact_fit(frame), "force_n", force)) > 3


def test_a_large_error_is_estimated_where_the_rig_states_a_uniform_beam(
    modules: dict[str, ModuleType],
) -> None:
    points, x_c, _ = pushed_points(0.12, 0.1)
    roll = 2e-3

    def rolled(one: Measurement) -> Floats:
        return np.array([[[0.0, roll]]]) * (one.points[None, :, :1] - 0.12)

    moved = points + [0.0, 1.0] * (roll * (points[:, :1] - 0.12))
    frame = measurement(moved, SIGMA, base_sigma=2e-6)
    assert frame.uniform
    estimate = exact_fit(frame.with_shared_errors(rolled))
    assert estimate.values, estimate
    assert abs(error(estimate, "x_c_m", x_c)) < 3
    assert estimate.sigma("x_c_m") < 1e-3 * BEAM.length
    del modules


def test_the_method_of_the_page_has_an_honest_covariance(modules: dict[str, ModuleType]) -> None:
    random, pulls = generator(__name__, 3), []
    points, x_c, force = pushed_points(0.12, 0.01)
    for _ in range(60):
        noise = np.column_stack(
            [np.zeros(len(points)), 5 * SIGMA * random.standard_normal(len(points))]
        )
        estimate = modules["linear_beam"].linear_beam(measurement(points + noise, 5 * SIGMA, 2e-6))
        deviation = [estimate.x_c_m - x_c, estimate.force_n - force]
        covariance = estimate.covariance_of("x_c_m", "force_n")
        pulls.append(deviation @ np.linalg.solve(covariance, deviation))
    # The mean of 60 chi-squares of two degrees of freedom is within 1.3 of 2 but once in 1e5 runs.
    assert np.mean(pulls) == pytest.approx(2.0, abs=1.3)
    straight = measurement(points * [1.0, 0.0], SIGMA, 2e-6)
    assert not modules["linear_beam"].linear_beam(straight).values


def test_what_is_ours_is_found_by_its_name(modules: dict[str, ModuleType]) -> None:
    frame = taken(heavy(0.9, 0.6, -0.6), -0.6, generator(__name__, 1))
    by_name = with_beam(find_method("exact_fit"), "heavy_tip:heavy_tip")(frame)
    assert by_name.values == modules["heavy_tip"].exact_fit_heavy(frame).values
    assert find_method("linear_beam:linear_beam") is modules["linear_beam"].linear_beam
    with pytest.raises(InputError, match="allowed is one of exact_fit, push_fit, push_fit_fri"):
        with_beam(find_method("two_point"), "heavy_tip:heavy_tip")
    with pytest.raises(InputError, match=r"beam 'heavy' is unknown, allowed is package\.mod"):
        with_beam(exact_fit, "heavy")


def test_the_centreline_of_the_page_is_honest(modules: dict[str, ModuleType]) -> None:
    del modules
    learn, random = find_extractor("bright_ridge:learn_bright_ridge"), generator(__name__, 4)
    light = {tilt: drawn(guide(0.0), bent(tilt), Look(ground=0.0)) for tilt in (0.0, 0.02)}
    extractor = learn([Sensor()(light[0.0], random)], guide(0.0))
    line = extractor(Sensor()(light[0.02], random))
    assert len(line.points) > 200
    error = distances(line.points, guide(0.0).pixels(bent(0.02)))
    rms = float(np.sqrt(np.mean(error**2)))
    assert 0.01 < rms < 0.2
    assert rms / 2 < np.median(line.sigma) < 2 * rms


def test_the_files_are_short() -> None:
    texts = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    lines = [text.strip().count("\n") + 1 for text in texts]
    assert [count <= most for count, most in zip(lines, (60, 15, 40, 40), strict=True)] == [
        True
    ] * 4
