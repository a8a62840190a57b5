from pathlib import Path

import numpy as np

from vbaa_bench.spec.load import load_scene
from vbaa_bench.spec.rigs import nominal_rig, true_rig
from vbaa_bench.spec.trials import random_generator, trials

FIG8 = Path(__file__).parents[3] / "scenes" / "fig8_rigid.yaml"


def test_names_are_opaque_and_unique() -> None:
    made = trials(load_scene(FIG8).scene)
    names = [trial.frame_id for trial in made]
    assert len(set(names)) == len(made) == 270
    assert names == sorted(names)
    # The order of names says nothing of what was pushed: rank correlation with the grid's index.
    ranks = np.argsort([trial.index for trial in made])
    assert abs(np.corrcoef(ranks, np.arange(270))[0, 1]) < 4 / np.sqrt(270)


def test_another_seed_gives_other_names_and_numbers() -> None:
    one, other = load_scene(FIG8).scene, load_scene(FIG8, seed=5).scene
    assert not {t.frame_id for t in trials(one)} & {t.frame_id for t in trials(other)}
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
