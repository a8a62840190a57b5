"""Wires cross the beam in the image, below everything that moves."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from solver.instrument.errors import InputError
from solver.instrument.transforms import apply, invert
from tests.conftest import SMALL_SCENE
from tests.draws import generator
from vbaa_bench.assembly.experiment import Experiment
from vbaa_bench.assembly.plan import plan
from vbaa_bench.assembly.pose import Pose
from vbaa_bench.assembly.scene_assembler import SceneAssembler
from vbaa_bench.assembly.wires import Wire, crossing, wires_surface
from vbaa_bench.scene.load import load_scene

WIRES = """
wires: {count: 9, height_mm: [-24, -8], crossing_deg: [40, 70], bow_pct: [-10, 10]}
object: {kind: peg, bottom_mm: -6}
"""


@given(st.floats(-0.2, 0.2), st.floats(0.02, 1.0))
def test_a_wire_is_a_tapered_arc(bow: float, tip_ratio: float) -> None:
    wire = Wire(0.2, 1e-3, tip_ratio, bow)
    line = wire.centreline(np.linspace(0.0, 1.0, 2001))
    assert np.linalg.norm(np.diff(line, axis=0), axis=1).sum() == pytest.approx(0.2, rel=1e-6)
    chord = line[-1] - line[0]
    sagitta = np.cross(chord, line[1000] - line[0])[2] / np.linalg.norm(chord)
    of_circle = (1 - np.cos(4 * bow)) / (8 * bow) if abs(bow) > 1e-5 else bow
    assert -sagitta == pytest.approx(of_circle * 0.2, abs=1e-9)
    mesh = wire.mesh()
    assert mesh.is_watertight
    # The cone's frustum, with a dodecagon in place of its circle.
    dodecagon = 12 / 2 * np.sin(2 * np.pi / 12) * 0.5e-3**2
    frustum = 0.2 * dodecagon * (1 + tip_ratio + tip_ratio**2) / 3
    assert mesh.volume == pytest.approx(frustum, rel=2e-3)


@pytest.mark.false_alarm(0.0, "the values are bounded, whatever is drawn")
@pytest.mark.parametrize("bow", [-0.1, 0.0, 0.1])
def test_it_crosses_the_beam_at_the_angle(bow: float) -> None:
    wire = Wire(0.2, 1e-3, 0.5, bow)
    for seed in range(20):
        random = generator(__name__, seed)
        pose = crossing(wire, 0.24, (1.0, 1.2), 3e-3, random)
        assert pose is not None
        line = apply(pose, wire.centreline(np.linspace(0.0, 1.0, 4001)))
        before = np.flatnonzero(np.diff(np.sign(line[:, 1])))[0]
        step = line[before + 1] - line[before]
        assert 0.1 * 0.24 - 1e-4 < line[before, 0] < 0.24 + 1e-4
        assert 0.999 < np.arctan2(step[1], step[0]) < 1.201
        assert np.linalg.norm(line[:, :2], axis=1).min() > 3e-3 + 0.5e-3


def test_there_may_be_no_room(random: np.random.Generator) -> None:
    wire = Wire(0.2, 1e-3, 1.0, 0.0)
    assert crossing(wire, 0.1, (1.0, 2.0), 0.5, random) is None


@pytest.mark.false_alarm(0.0, "wires are drawn so that none touches; paints are bounded")
@pytest.mark.parametrize("fixed_to", ["antenna", "world"])
def test_wires_touch_nothing(fixed_to: str, tmp_path: Path) -> None:
    path = tmp_path / "scene.yaml"
    scene = SMALL_SCENE + WIRES + f"background: {{fixed_to: {fixed_to}}}\n"
    path.write_text(scene, encoding="utf-8")
    file = load_scene(path)
    work = plan(file)
    surface = wires_surface(file.scene, work.rig)
    assert surface is not None
    parts = surface.mesh.split(only_watertight=True)
    assert len(parts) == 9
    bounds = sorted((part.bounds[0, 2], part.bounds[1, 2]) for part in parts)
    for (_, top), (bottom, _) in pairwise(bounds):
        assert top < bottom
    assert surface.texture is not None
    assert 0.1 <= surface.texture.image.min() < surface.texture.image.max() <= 0.6
    lowest = np.inf
    for spec in work.frame_specs:
        experiment = Experiment(file.scene, work.rig, spec.push, tmp_path)
        state = experiment.states()[spec.step]
        touched: trimesh.Trimesh = experiment.touched_mesh(state, spec.step)
        lowest = min(lowest, touched.bounds[0, 2], state.centreline[:, 3].min())
        if fixed_to == "antenna":  # the bent beam is still above wires
            line = state.centreline[:, 1:]
            assert _crossings(parts, line) >= 1  # of nine
        else:
            turn = invert(experiment.clamp_from_world(spec.motor_angle(state.pushing_angle)))
            assert _crossings(parts, apply(turn, state.centreline[:, 1:])) >= 1
    assert bounds[-1][1] < lowest - 1e-3


def _crossings(parts: list[trimesh.Trimesh], line: np.ndarray) -> int:
    """Count the wires that have vertices on both sides of the line (n, 3) within its length."""
    count = 0
    for part in parts:
        points = part.vertices[(part.vertices[:, 0] > 0) & (part.vertices[:, 0] < line[-1, 0])]
        side = points[:, 1] - np.interp(points[:, 0], line[:, 0], line[:, 1])
        count += bool(len(points)) and bool(side.min() < 0 < side.max())
    return count


@pytest.mark.parametrize(
    ("extra", "message"),
    [
        ("wires: {}", "object.bottom_mm is None, allowed is above the wires, whose highest"),
        ("wires: {}\nobject: {kind: peg, bottom_mm: -12}", "object.bottom_mm is -12.0, allowed"),
        ("wires: {height_mm: [-10, -20]}", "height_mm is [-10.0, -20.0], allowed is a range from"),
        ("wires: {count: 40}", "allowed is a range of at least 31.2 for 40 wires of up to 0.8 mm"),
        (
            "wires: {height_mm: [-30, -10]}\nobject: {kind: peg, bottom_mm: -5}",
            "the lowest point is -30.4; allowed is above the ground and what is on it, -30",
        ),
        (
            "wires: {}\nclamp: {}\nobject: {kind: peg, bottom_mm: -5}",
            "wires and clamp are both given, allowed is one of them",
        ),
        (
            "wires: {height_mm: [-8, -2]}\nobject: {kind: peg, bottom_mm: -1}\n"
            "gravity_m_s2: [0, 0, -9.81]",
            "wires.height_mm ends at -2, but the beam reaches 4.",
        ),
    ],
)
def test_what_is_impossible(extra: str, message: str, tmp_path: Path) -> None:
    path = tmp_path / "scene.yaml"
    path.write_text(SMALL_SCENE + extra, encoding="utf-8")
    with pytest.raises(InputError) as error:
        plan(load_scene(path))
    assert message in str(error.value)


@pytest.mark.parametrize("fixed_to", ["antenna", "world"])
def test_wires_turn_with_the_ground(fixed_to: str, tmp_path: Path) -> None:
    path = tmp_path / "scene.yaml"
    scene = SMALL_SCENE + WIRES + f"background: {{fixed_to: {fixed_to}}}\n"
    path.write_text(scene, encoding="utf-8")
    file = load_scene(path)
    work = plan(file)
    spec = next(iter(work.frame_specs))
    experiment = Experiment(file.scene, work.rig, spec.push, tmp_path)
    assembler = SceneAssembler(file.scene, work.rig, tmp_path)
    pose = Pose(experiment, spec, experiment.states()[spec.step])
    vertices = assembler.surfaces(pose)["wires"].mesh.vertices
    surface = wires_surface(file.scene, work.rig)
    assert surface is not None
    turned = np.eye(4)
    if fixed_to == "world":
        turned = experiment.clamp_from_world(pose.motor_angle)
        turned[:3, 3] += work.rig.base_position
        assert pose.motor_angle != 0
    assert vertices == pytest.approx(apply(turned, surface.mesh.vertices), abs=1e-12)
