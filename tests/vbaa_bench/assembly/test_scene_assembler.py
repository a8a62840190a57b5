"""A world is the same whichever frame it was put up for."""

from pathlib import Path

import numpy as np
import pytest

from solver.instrument.arrays import Floats
from tests.draws import scene_seed, seeded
from vbaa_bench.assembly.experiment import Experiment
from vbaa_bench.assembly.plan import plan
from vbaa_bench.assembly.pose import Pose
from vbaa_bench.assembly.scene_assembler import SceneAssembler
from vbaa_bench.render.frame import NoiseTarget, RenderedRadiance, render_frame, render_static_layer
from vbaa_bench.render.variant import activate
from vbaa_bench.scene.load import load_scene

SCENE = seeded("""
title: Ground that turns, and a cover that is away
seed: 4
camera: {width_px: 160, height_px: 160, focal_length_px: 200}
background: {pattern: PATTERN, fixed_to: world, square_mm: 18, reflectance: 0.3}
occlusion: {kind: [sheet], place: [middle], availability: [1.0, 0.6]}
pushes: {contact_distance_mm: [120], pushing_angle_deg: [-4, 8]}
""")


def noise(radiance: Floats) -> Floats:
    return np.asarray(0.1 * radiance + 0.01)


@pytest.mark.thorough
@pytest.mark.parametrize("pattern", ["squares", "plain", "textured"])
def test_the_first_frame_leaves_no_trace(pattern: str, tmp_path: Path, variant: str) -> None:
    activate(variant, 2)
    path = tmp_path / "scene.yaml"
    path.write_text(SCENE.replace("PATTERN", pattern), encoding="utf-8")
    file = load_scene(path)
    work = plan(file)
    assembler = SceneAssembler(file.scene, work.rig, tmp_path)
    poses = []
    for spec in sorted(work.frame_specs, key=lambda spec: spec.index):
        experiment = Experiment(file.scene, work.rig, spec.push, tmp_path)
        poses.append(Pose(experiment, spec, experiment.states()[spec.step]))

    def rendered(first: Pose) -> RenderedRadiance:
        world, target = assembler.pushed_world(first), NoiseTarget(noise)
        still = render_static_layer(world, target, scene_seed(1))
        assembler.repose(world, poses[1])
        return render_frame(world, still, target, scene_seed(2))

    one, other = rendered(poses[0]), rendered(poses[-1])
    assert (one.radiance == other.radiance).all()
    assert (one.layers.object_index == other.layers.object_index).all()
    assert (one.samples == other.samples).all()


CLAMPED = seeded("""
title: A clamp that turns
seed: 4
camera: {width_px: 160, height_px: 160, focal_length_px: 200, mount: MOUNT}
clamp: {}
clutter: {count: 40}
pushes:
  {contact_distance_mm: [120], pushing_angle_deg: [8], motor_angle_at_contact_deg: [10, 20]}
""")


def test_the_clamp_turns_with_the_beam(tmp_path: Path) -> None:
    surfaces, angle = {}, 0.0
    for mount in ("antenna", "world"):
        path = tmp_path / f"{mount}.yaml"
        path.write_text(CLAMPED.replace("MOUNT", mount), encoding="utf-8")
        file = load_scene(path)
        work = plan(file)
        spec = work.frame_specs[0]
        experiment = Experiment(file.scene, work.rig, spec.push, tmp_path)
        pose = Pose(experiment, spec, experiment.states()[0])
        assembler = SceneAssembler(file.scene, work.rig, tmp_path)
        surfaces[mount] = assembler.surfaces(pose)
        angle = pose.motor_angle
        clamp = {"hub", "jaw", "screw", "flange", "cable"}
        assert clamp <= set(surfaces[mount])
        assert (clamp <= assembler._still) == (mount == "antenna")
        # The default ground, and what is on it, is fixed to the antenna.
        assert ("clutter_matt" in assembler._still) == (mount == "antenna")
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    assert abs(angle) > 0.01
    # In a turning frame the ground that may come into view is larger: places differ.
    surfaces["antenna"]["clutter_matt"] = dict(assembler._clutter)["clutter_matt"]
    for name in ("beam", "jaw", "cable", "clutter_matt"):
        fixed, turned = (np.asarray(surfaces[m][name].mesh.vertices) for m in surfaces)
        assert turned[:, :2] == pytest.approx(fixed[:, :2] @ turn.T, abs=1e-9)
        assert turned[:, 2] == pytest.approx(fixed[:, 2], abs=1e-12)
