"""A world is the same whichever frame it was put up for."""

from pathlib import Path

import numpy as np
import pytest

from solver.instrument.arrays import Floats
from vbaa_bench.assembly.experiment import Experiment
from vbaa_bench.assembly.scene_assembler import Pose, SceneAssembler
from vbaa_bench.generation.plan import plan
from vbaa_bench.render.frame import NoiseTarget, RenderedRadiance, render_frame, render_static_layer
from vbaa_bench.render.variant import activate
from vbaa_bench.scene.load import load_scene

SCENE = """
title: Ground that turns, and a cover that is away
seed: 4
camera: {width_px: 160, height_px: 160, focal_length_px: 200}
background: {pattern: PATTERN, fixed_to: world, square_mm: 18, reflectance: 0.3}
occlusion: {kind: [sheet], place: [middle], availability: [1.0, 0.6]}
pushes: {contact_distance_mm: [120], pushing_angle_deg: [-4, 8]}
"""


def noise(radiance: Floats) -> Floats:
    return np.asarray(0.1 * radiance + 0.01)


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
        still = render_static_layer(world, target, 1)
        assembler.repose(world, poses[1])
        return render_frame(world, still, target, 2)

    one, other = rendered(poses[0]), rendered(poses[-1])
    assert (one.radiance == other.radiance).all()
    assert (one.layers.object_index == other.layers.object_index).all()
    assert (one.samples == other.samples).all()
