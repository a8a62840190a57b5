"""Motion in an exposure: the poses that a frame shows, and that it is their weighted mean."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from solver.instrument.errors import InputError
from solver.instrument.units import DEGREE
from tests.conftest import SMALL_SCENE
from vbaa_bench.assembly.experiment import Experiment
from vbaa_bench.assembly.motion import STEP_PX, averaged_poses, exposure_poses, pose_weights
from vbaa_bench.assembly.plan import plan
from vbaa_bench.assembly.pose import Pose
from vbaa_bench.render.frame import RenderedRadiance, average_poses
from vbaa_bench.render.layers import Layers
from vbaa_bench.scene.load import SceneFile, load_scene
from vbaa_bench.sensor.shutter import STEADY

MOVING = SMALL_SCENE + "motor_speed_deg_s: 20\nsensor: {rest_images: 2, exposure_s: 0.01}\n"


def scene_file(tmp_path: Path, text: str) -> SceneFile:
    path = tmp_path / "moving.yaml"
    path.write_text(text, encoding="utf-8")
    return load_scene(path)


def pose_of(file: SceneFile) -> tuple[Pose, SceneFile]:
    work = plan(file)
    spec = next(iter(work.frame_specs))
    experiment = Experiment(file.scene, work.rig, spec.push, file.path.parent)
    return Pose(experiment, spec, experiment.states()[spec.step]), file


def test_poses_stand_evenly_about_the_one_asked_for(tmp_path: Path) -> None:
    text = MOVING.replace("sensor: {rest_images: 2}\n", "", 1)
    pose, file = pose_of(scene_file(tmp_path, text))
    poses = exposure_poses(pose, file.scene, pose.experiment.rig)
    angles = np.array([each.state.pushing_angle for each in poses])
    middle = len(poses) // 2
    assert poses[middle] is pose
    assert angles + angles[::-1] == pytest.approx(2 * angles[middle])
    # Each stands for an even share of the 0.2 degrees.
    assert np.diff(angles) * len(poses) == pytest.approx(0.2 * DEGREE, rel=1e-6)
    tips = np.array([each.state.tip for each in poses])
    pixel = 0.36 / 700
    assert np.linalg.norm(np.diff(tips, axis=0), axis=1).max() < 1.5 * STEP_PX * pixel
    assert len(poses) > 3


def test_a_motor_at_rest_blurs_nothing(tmp_path: Path) -> None:
    pose, file = pose_of(scene_file(tmp_path, SMALL_SCENE))
    assert exposure_poses(pose, file.scene, pose.experiment.rig) == [pose]


def test_blur_has_no_memory(tmp_path: Path) -> None:
    text = SMALL_SCENE + "motor_speed_deg_s: 20\nobject: {kind: block, friction: 0.2}\n"
    with pytest.raises(InputError, match="blur is modelled for a frictionless push"):
        scene_file(tmp_path, text)


@pytest.mark.false_alarm(0.0, "the values are bounded, whatever is drawn")
def test_each_row_of_a_rolling_shutter_sees_the_angle_of_its_time(tmp_path: Path) -> None:
    text = MOVING.replace("sensor: {rest_images: 2}\n", "", 1)
    text = text.replace("exposure_s: 0.01", "exposure_s: 0.01, line_time_us: 100")
    pose, file = pose_of(scene_file(tmp_path, text))
    poses = exposure_poses(pose, file.scene, pose.experiment.rig)
    weights = pose_weights(file.scene, len(poses), STEADY)
    assert weights is not None
    assert poses[len(poses) // 2] is pose
    angles = np.array([each.state.pushing_angle for each in poses]) - pose.state.pushing_angle
    # 20 degrees per second; the readout of 176 rows is about the middle of the exposure.
    expected = 20 * DEGREE * 1e-4 * (np.arange(176) - 87.5)
    assert weights @ angles == pytest.approx(expected, abs=1e-9)
    # A row sees about a third of the poses.
    assert len(poses) / 4 < averaged_poses(file.scene, len(poses)) < len(poses) / 2
    tips = np.array([each.state.tip for each in poses])
    assert np.linalg.norm(np.diff(tips, axis=0), axis=1).max() < 1.5 * STEP_PX * 0.36 / 700


def test_only_so_much_motion_fits_a_readout(tmp_path: Path) -> None:
    text = SMALL_SCENE.replace("rest_images: 2", "exposure_s: 0.001, line_time_us: 1000")
    with pytest.raises(
        InputError,
        match=r"exposure_s is 0\.001 and sensor.line_time_us is 1000: the motor turns by 17\.6",
    ):
        scene_file(tmp_path, text + "motor_speed_deg_s: 100\n")


def flat(value: float) -> RenderedRadiance:
    image = np.full((2, 3), value)
    return RenderedRadiance(image, 0.1 * image, Layers.empty(2, 3), image / 10, image, image > 0)


def test_pictures_together_are_their_mean() -> None:
    one, two, three = (flat(value) for value in (1.0, 2.0, 6.0))
    mean = average_poses([one, two, three])
    assert (mean.radiance == 3).all()
    assert mean.variance == pytest.approx((0.1 + 0.2 + 0.6) / 9)
    assert mean.layers is two.layers
    assert (mean.samples == 9).all()
    assert replace(average_poses([one])) == one


def test_each_row_weights_pictures_and_their_variance_in_its_own_way() -> None:
    one, two, three = (flat(value) for value in (1.0, 2.0, 6.0))
    weights = np.array([[0.5, 0.5, 0.0], [0.0, 0.6, 1.2]])
    mean = average_poses([one, two, three], weights)
    assert mean.radiance == pytest.approx(np.repeat([[1.5], [8.4]], 3, 1))
    assert mean.variance == pytest.approx(np.repeat([[0.075], [0.072 + 0.864]], 3, 1))
    # The power of the light does not change what the beam covers.
    assert mean.coverage == pytest.approx(np.repeat([[0.15], [(0.2 + 2 * 0.6) / 3]], 3, 1))
    assert mean.layers is two.layers
    assert (mean.samples == 9).all()


def test_a_level_scales_the_light_and_its_noise() -> None:
    half = flat(2.0).at_level(0.5)
    assert (half.radiance == 1).all()
    assert half.variance == pytest.approx(0.2 * 0.25)
    one = flat(1.0)
    assert one.at_level(1.0) is one
