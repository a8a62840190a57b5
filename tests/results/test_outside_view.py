"""The rig from outside: beam and contact are in the picture, everything in its colour."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from results.pictures.outside_rig import rig_bodies, viewpoint
from results.pictures.outside_view import outside_view
from solver.instrument.errors import InputError
from solver.instrument.transforms import camera_looking_at, invert
from tests.conftest import SMALL_SCENE
from vbaa_bench.assembly.experiment import Experiment
from vbaa_bench.assembly.plan import plan
from vbaa_bench.assembly.pose import Pose
from vbaa_bench.assembly.scene_assembler import SceneAssembler
from vbaa_bench.render.illumination import lights
from vbaa_bench.render.variant import PLAIN, activate
from vbaa_bench.scene.load import load_scene

EXTRA = "lights: [{kind: area}]\nclamp: {}\nclutter: {count: 5}\n"
WIDTH, HEIGHT = 120, 80


def test_beam_and_contact_are_in_the_picture(tmp_path: Path) -> None:
    path = tmp_path / "scene.yaml"
    path.write_text(SMALL_SCENE + EXTRA, encoding="utf-8")
    file = load_scene(path)
    work = plan(file)
    spec = work.frame_specs[0]
    experiment = Experiment(file.scene, work.rig, spec.push, tmp_path)
    assembler = SceneAssembler(file.scene, work.rig, tmp_path)
    pose = Pose(experiment, spec, experiment.states()[spec.step])
    lamps = lights(file.scene, tmp_path)
    bodies = rig_bodies(assembler, assembler.surfaces(pose), lamps)
    assert {"beam", "jaw", "object", "camera", "lens", "motor", "housing_0"} <= set(bodies)
    for name in ("camera", "lens", "stand", "motor", "housing_0"):
        mesh = bodies[name].surface.mesh
        assert mesh.is_watertight
        assert mesh.volume > 0
    # No part of the camera is in its own view: everything is behind the pinhole.
    to_camera = work.rig.camera.camera_from_antenna
    for name in ("camera", "lens"):
        depth = bodies[name].surface.mesh.vertices @ to_camera[2, :3] + to_camera[2, 3]
        assert depth.max() < 1e-9
    where = viewpoint(assembler)
    view = camera_looking_at(where.position, where.target, 0.0)
    # Up is +z, as in the renderer.
    half_height = np.tan(np.radians(where.fov_deg) / 2)
    for name in ("beam", "object", "jaw", "motor"):
        points = np.asarray(bodies[name].surface.mesh.vertices)
        away = points - where.position
        ahead = invert(view)[:3, 2]
        up = np.array([0, 0, 1.0]) - ahead[2] * ahead
        up /= np.linalg.norm(up)
        depth = away @ ahead
        assert np.abs(away @ up / depth).max() < half_height
        assert np.abs(away @ np.cross(up, ahead) / depth).max() < half_height * WIDTH / HEIGHT


def test_a_picture_is_in_colour(tmp_path: Path, variant: str) -> None:
    if variant == PLAIN:
        pytest.skip("slow without LLVM, and the same")
    path, out = tmp_path / "scene.yaml", tmp_path / "rig.png"
    path.write_text(SMALL_SCENE + EXTRA, encoding="utf-8")
    file = load_scene(path)
    outside_view(file, 0, out, variant, size_px=(WIDTH, HEIGHT), samples=16)
    activate(variant, 2)  # other tests are in gray
    image = np.asarray(cv2.imread(str(out)), dtype=float)
    assert image.shape == (HEIGHT, WIDTH, 3)
    blue, _, red = np.moveaxis(image, 2, 0)
    # A wooden table below, a room above, and the blue object.
    assert (red - blue)[-15:].mean() > 20
    assert abs((red - blue)[:5].mean()) < 20
    assert (blue - red).max() > 30
    with pytest.raises(InputError, match="frame 4 does not exist, allowed is 0 to 3"):
        outside_view(file, 4, out, variant)
