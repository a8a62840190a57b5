from pathlib import Path

import numpy as np
import pytest

from solver.instrument.beam_shape import CLAMP_SHIFT
from solver.instrument.errors import InputError
from tests.conftest import SMALL_SCENE
from vbaa_bench.assembly.experiment import SPATIAL, Experiment
from vbaa_bench.generation.readings import readings
from vbaa_bench.scene.frames import Frames, frame_specs
from vbaa_bench.scene.load import load_scene
from vbaa_bench.scene.random_streams import random_generator
from vbaa_bench.scene.rigs import nominal_rig, true_rig
from vbaa_bench.scene.schema import Scene

SCENES = Path(__file__).parents[3] / "scenes"
FIG8 = SCENES / "fig8_rigid.yaml"


def test_names_are_opaque_and_unique() -> None:
    made = frame_specs(load_scene(FIG8).scene)
    names = [trial.frame_id for trial in made]
    assert len(set(names)) == len(made) == 270
    # Repetition by repetition, so that a set with more of them keeps its files.
    assert [(t.repeat, t.frame_id) for t in made] == sorted((t.repeat, t.frame_id) for t in made)
    # The order of names says nothing of what was pushed: rank correlation with the grid's index.
    places = [trial.index % 27 for trial in made]
    assert abs(np.corrcoef(places, np.arange(270))[0, 1]) < 4 / np.sqrt(270)


def test_another_seed_gives_other_names_and_numbers() -> None:
    one, other = load_scene(FIG8).scene, load_scene(FIG8, seed=5).scene
    assert not {t.frame_id for t in frame_specs(one)} & {t.frame_id for t in frame_specs(other)}
    assert (
        random_generator(one, "sensor", 3).random() != random_generator(other, "sensor", 3).random()
    )


def test_random_numbers_depend_on_stage_and_trial_alone() -> None:
    scene = load_scene(FIG8).scene
    first = random_generator(scene, "sensor", 3).random(4)
    random_generator(scene, "sensor", 4).random(100)
    assert (random_generator(scene, "sensor", 3).random(4) == first).all()
    assert (random_generator(scene, "rest", 3).random(4) != first).all()
    assert (random_generator(scene, "sensor", 2).random(4) != first).all()


def test_a_drawn_rig_lies_off_its_nominal_by_its_tolerances() -> None:
    nominal_scene = load_scene(FIG8).scene
    exact = true_rig(nominal_scene)
    rig = nominal_rig(nominal_scene)
    assert exact.beam == rig.beam
    assert (exact.antenna_from_board == rig.antenna_from_board).all()
    drawn_tolerances = nominal_scene.tolerances.model_copy(update={"true_rig": "drawn"})
    pulls = []
    for seed in range(60):
        scene = nominal_scene.model_copy(update={"tolerances": drawn_tolerances, "seed": seed})
        drawn = true_rig(scene)
        board = drawn.antenna_from_board[:3, 3] - rig.antenna_from_board[:3, 3]
        pulls.append(
            [
                (drawn.beam.length - rig.beam.length) / rig.tolerances.beam_length,
                (drawn.beam.flexural_rigidity / rig.beam.flexural_rigidity - 1) / 0.01,
                *(drawn.base_position / rig.tolerances.base_position),
                *(board / rig.tolerances.board_translation),
            ]
        )
    spread = np.std(pulls, axis=0)
    assert ((spread > 0.65) & (spread < 1.4)).all()  # 60 draws: 1 +- 0.09


def test_a_beam_gripped_deeper_is_shorter_and_farther_from_the_axis() -> None:
    def scene_with(grip_mm: float, true: str) -> Scene:
        scene = load_scene(FIG8).scene
        update = {"true_rig": true, "grip_mm": grip_mm}
        return scene.model_copy(update={"tolerances": scene.tolerances.model_copy(update=update)})

    assert true_rig(scene_with(1.0, "nominal")).grip == 0
    drawn, plain = (true_rig(scene_with(grip, "drawn")) for grip in (1.0, 0.0))
    assert 1e-5 < abs(drawn.grip) < 4e-3
    assert drawn.beam.length == pytest.approx(plain.beam.length - drawn.grip)
    assert drawn.base_position == pytest.approx(
        plain.base_position + np.array([drawn.grip, 0.0, 0.0])
    )
    # All else is drawn as without.
    assert drawn.beam.flexural_rigidity == plain.beam.flexural_rigidity
    assert (drawn.antenna_from_board == plain.antenna_from_board).all()
    scene = scene_with(1.0, "drawn")
    experiment = Experiment(scene, drawn, frame_specs(scene)[0].push, SCENES)
    assert experiment.motor.point == (-drawn.grip, 0.0, 0.0)
    assert experiment.model == SPATIAL
    assert nominal_rig(scene).shape.sigma(CLAMP_SHIFT) == pytest.approx(1 / 240)


@pytest.mark.parametrize("name", ["clamp_offset_mm", "grip_mm"])
def test_a_camera_in_the_world_has_its_clamp_on_the_axis(name: str, tmp_path: Path) -> None:
    path = tmp_path / "scene.yaml"
    scene = SMALL_SCENE.replace("camera:\n", "camera:\n  mount: world\n")
    path.write_text(f"{scene}\ntolerances: {{{name}: 1}}\n")
    with pytest.raises(InputError, match=f"tolerances.{name} is 1, allowed is 0"):
        load_scene(path)


def test_every_push_begins_at_a_motor_angle_of_its_own() -> None:
    made = sorted(frame_specs(load_scene(FIG8).scene), key=lambda trial: trial.index)
    onsets = {trial.push_id: trial.onset for trial in made}
    assert all(onsets[trial.push_id] == trial.onset for trial in made)
    assert len(set(onsets.values())) == len(onsets) == 90
    degrees = np.degrees(list(onsets.values()))
    assert np.abs(degrees).max() <= 10
    assert np.ptp(degrees) > 15
    # Mechanics does not depend on it, so that pushes are solved once for all repeats.
    assert len({trial.push for trial in made}) == 9


def test_no_other_draw_depends_on_that_of_the_motor_angle() -> None:
    scene = load_scene(SCENES / "train_2d_one_look.yaml").scene
    assert scene.sampling is not None
    fixed = scene.sampling.model_copy(update={"motor_angle_at_contact_deg": (5.0, 5.0)})
    by_index = [
        sorted(frame_specs(one), key=lambda trial: trial.index)
        for one in (scene, scene.model_copy(update={"sampling": fixed}))
    ]
    drawn, same = by_index
    assert [trial.push for trial in drawn] == [trial.push for trial in same]
    assert len({trial.onset for trial in drawn}) == 500
    # A push of one step is drawn by the motor angle of that step.
    rig = true_rig(scene)
    for trial in same[:10]:
        (state,) = Experiment(trial.scene, rig, trial.push, SCENES).states()
        assert np.degrees(trial.motor_angle(state.pushing_angle)) == pytest.approx(5, abs=0.1)


@pytest.mark.parametrize("name", ["train_2d", "train_3d"])
def test_training_sets_keep_their_frames_when_they_grow(name: str) -> None:
    scene = load_scene(SCENES / f"{name}.yaml").scene
    assert scene.pushes is not None
    assert Frames(scene).count == 500
    small, large = (
        frame_specs(scene.model_copy(update={"pushes": pushes}))
        for pushes in (scene.pushes.model_copy(update={"repeats": n}) for n in (4, 8))
    )
    assert large[:4] == small
    assert [trial.scene.lights for trial in large[:4]] == [trial.scene.lights for trial in small]
    # Ring lamps are all alike, and everything else differs from frame to frame.
    assert len({trial.scene.lights for trial in large}) > 2
    assert len({trial.scene.background for trial in large}) == 8
    assert len({trial.scene.object for trial in large}) == 8


def test_encoder_and_tip_do_not_tell_the_contact() -> None:
    file = load_scene(FIG8)
    rig = true_rig(file.scene)
    states = {
        push: Experiment(file.scene, rig, push, FIG8.parent).states()
        for push in {trial.push for trial in frame_specs(file.scene)}
    }
    seen = np.array(
        [
            (
                float(readings(file.scene, trial, state, None)["motor_angle_deg"]),
                state.tip[1] / 0.24 * 100,
                state.contact.point[0] / 0.24,
            )
            for trial in frame_specs(file.scene)
            for state in [states[trial.push][trial.step]]
        ]
    )
    # Of each frame the nearest other, in angle [deg] and deflection [%], says where the contact is.
    apart = np.linalg.norm(seen[:, None, :2] - seen[None, :, :2], axis=2)
    np.fill_diagonal(apart, np.inf)
    error = seen[apart.argmin(axis=1), 2] - seen[:, 2]
    # Contacts spread over a standard deviation of 21 % of L; with a fixed angle this errs by none.
    assert np.sqrt(np.mean(error**2)) > 0.15
