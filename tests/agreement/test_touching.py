"""Every scene is possible; beam and object touch and do not intersect: mechanics and geometry."""

from pathlib import Path

import numpy as np
import pytest
import trimesh
from scipy.interpolate import CubicSpline
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist

from solver.instrument.arrays import Floats
from vbaa_bench.assembly.experiment import Experiment
from vbaa_bench.assembly.plan import plan
from vbaa_bench.assembly.pose import Pose
from vbaa_bench.assembly.scene_assembler import SceneAssembler
from vbaa_bench.mechanics.state import State
from vbaa_bench.scene.frames import Frames
from vbaa_bench.scene.load import load_scene
from vbaa_bench.scene.objects.pad import PadSpec
from vbaa_bench.scene.objects.weight import WeightSpec
from vbaa_bench.scene.shipped import shipped_scene_files

SCENES = shipped_scene_files()
MICROMETRE = 1e-6
# Random pushes that are solved, spread over all. Chosen: an impossible draw is repeated up to 64
# times, so that more pushes find no more, and 16 cover the ranges of a scene.
RANDOM_PUSHES = 16
# What does not move the beam or the object: scenes that differ in nothing else touch alike.
LOOKS = {
    *("title", "seed", "look", "camera", "optics", "light", "lights", "light_level", "flicker"),
    *("ambient", "background", "clutter", "wires", "sensor", "render", "layers"),
    *("frames_per_shard", "calibration", "sampling", "splits"),
}
# Pairs of a point and a triangle at once. Chosen: more exceed the processor's cache.
_PAIRS = 3000
# Relative and absolute tolerance of a bound by which triangles are left out. Chosen: well above
# the rounding of distances.
_RELATIVE, _ABSOLUTE = 1e-5, 1e-9


def distances(points: Floats, mesh: trimesh.Trimesh, reach: float) -> Floats:
    """Signed distance [m] of each point (n, 3) from a mesh, inf beyond `reach`."""
    triangles, normals = mesh.triangles, mesh.face_normals
    middles = triangles.mean(axis=1)
    radii = np.linalg.norm(triangles - middles[:, None], axis=2).max(axis=1)
    near, _ = cKDTree(points).query(middles)
    close = near < radii + reach
    triangles, normals, middles, radii = (a[close] for a in (triangles, normals, middles, radii))
    if not len(triangles):
        return np.full(len(points), np.inf)
    # A triangle lies in a ball about its middle, and reaches that middle: of the pairs, only those
    # whose ball is nearer than `reach` and than any middle can have the least distance.
    apart = cdist(points, middles)
    least = np.minimum(apart.min(axis=1), reach)[:, None]
    rows, columns = np.nonzero(apart - radii <= least * (1 + _RELATIVE) + _ABSOLUTE)
    nearest = np.concatenate(
        [
            trimesh.triangles.closest_point(  # type: ignore[no-untyped-call]
                triangles[columns[batch]], points[rows[batch]]
            )
            for batch in np.array_split(np.arange(len(rows)), len(rows) // _PAIRS + 1)
        ]
    )
    away = points[rows] - nearest
    squares, least_squares = (away**2).sum(axis=1), np.full(len(points), np.inf)
    np.minimum.at(least_squares, rows, squares)
    # Beside an edge the face whose normal is nearest to the point's direction decides the side.
    closest = squares <= least_squares[rows] * (1 + 1e-6) + 1e-24
    towards = np.full(len(points), -np.inf)
    facing = (normals[columns] * away).sum(axis=1)
    np.maximum.at(towards, rows[closest], facing[closest])
    # Farther off, the nearest triangle may be one of those left out.
    signed = np.where(towards >= 0, 1, -1) * np.sqrt(least_squares)
    return np.where(least_squares < reach**2, signed, np.inf)


# Scenes whose contacts were examined, without their looks.
_EXAMINED: set[str] = set()


def about_the_contact(state: State, width: float) -> Floats:
    """Points (n, 3) of the centreline, close together, about the contact."""
    line, s = state.centreline, state.contact.s
    fine = np.linspace(-1, 1, 401) ** 3 * width + s
    return np.asarray(CubicSpline(line[:, 0], line[:, 1:])(fine[(fine > 0) & (fine < line[-1, 0])]))


@pytest.mark.thorough
@pytest.mark.parametrize("path", SCENES, ids=lambda path: f"{path.parent.name}/{path.stem}")
def test_every_scene_is_possible_and_beam_and_object_touch_without_intersecting(
    path: Path,
) -> None:
    file = load_scene(path)
    scene, frames = file.scene, Frames(file.scene)
    assert frames.count * (file.rigs or 1) >= 18
    # Random pushes are all of one distribution; of a grid every push is solved.
    spacing = max(frames.pushes // RANDOM_PUSHES, 1) if scene.random_keys else 1
    work = plan(file, pushes=range(0, frames.pushes, spacing))
    mechanics = scene.model_dump_json(exclude=LOOKS)
    if mechanics in _EXAMINED:
        return
    _EXAMINED.add(mechanics)
    touching = 0
    pushes = list(dict.fromkeys(spec.push for spec in work.frame_specs))
    for push in pushes[:: -(-len(pushes) // 3)]:  # three, spread over all
        experiment = Experiment(scene, work.rig, push, path.parent)
        states = experiment.states()
        assert max(state.residual for state in states) < 1e-8
        step = len(states) - 1
        state = states[step]
        if not state.contacts:
            continue
        # In units in which every scene's beam has the size of the reference beam.
        unit = work.rig.beam.length / 0.24
        reach = -float(state.contact.lever @ state.contact.normal)
        if scene.mechanics == "linear":
            reach = work.rig.beam.radius
        if isinstance(scene.object, WeightSpec):  # it pulls at the axis, by a loop
            reach = experiment.rod.half_height(state.contact.s)
        mesh = experiment.touched_mesh(state, step)
        mesh.vertices = np.asarray(mesh.vertices) / unit
        near = distances(about_the_contact(state, 4 * reach) / unit, mesh, 4 * reach / unit)
        gap = near.min() - reach / unit
        touching += 1
        if isinstance(scene.object, PadSpec | WeightSpec):
            # It hugs the beam, or its lower half, with a polygon about its circle.
            assert -MICROMETRE < gap < 0.01 * reach
        else:
            assert abs(gap) < MICROMETRE, f"gap {gap:.2e} m at {push}"
        tapered = 1 + (scene.beam.tip_ratio - 1) * state.centreline[:, 0] / work.rig.beam.length
        rows = slice(4, None, 3)
        everywhere = distances(state.centreline[rows, 1:] / unit, mesh, 4 * reach / unit)
        assert (everywhere - reach / unit * np.minimum(tapered[rows], 1)).min() > -MICROMETRE
        # Every object stands on the ground, or above it.
        assert mesh.vertices[:, 2].min() * unit > experiment.ground - 1e-9 * unit
    assert touching or scene.object.kind == "none" or path.stem == "free_beam"


@pytest.mark.thorough
def test_a_second_peg_stands_upright_and_touches() -> None:
    path = next(path for path in SCENES if path.stem == "two_pegs")
    file = load_scene(path)
    # One push: every push of the scene is solved in the test above.
    scene, work = file.scene, plan(file, pushes=[0])
    deepest = max(work.frame_specs, key=lambda spec: spec.step)
    experiment = Experiment(scene, work.rig, deepest.push, path.parent)
    states = experiment.states()
    assert deepest.step == len(states) - 1
    pose = Pose(experiment, deepest, states[-1])
    assert len(pose.state.contacts) == 2
    second = pose.state.contacts[1]
    assert second.force[1] < 0  # it holds the beam back
    peg = dict(SceneAssembler(scene, work.rig, path.parent).object_surfaces(pose))[
        "second_peg"
    ].mesh
    assert peg.bounds[:, 2] == pytest.approx([-0.03, 0.4e-3])
    around = CubicSpline(pose.state.centreline[:, 0], pose.state.centreline[:, 1:])(
        np.linspace(second.s - 1e-3, second.s + 1e-3, 401)
    )
    assert distances(around, peg, 2e-3).min() == pytest.approx(0.4e-3, abs=MICROMETRE)
