from pathlib import Path

import numpy as np
import pytest

from solver.instrument.errors import InputError
from solver.instrument.transforms import turn_about_z
from vbaa_bench.assembly.experiment import Experiment
from vbaa_bench.generation.truth_row import truth_row
from vbaa_bench.scene.frames import frame_specs
from vbaa_bench.scene.load import load_scene
from vbaa_bench.scene.rigs import true_gravity, true_rig

SCENES = Path(__file__).parents[3] / "scenes"
FIG8, HUNG_WEIGHT = SCENES / "fig8_rigid.yaml", SCENES / "hard" / "hung_weight.yaml"


@pytest.mark.parametrize("mechanics", ["exact", "linear"])
@pytest.mark.parametrize("target", ["deflection_pct", "pushing_angle_deg"])
def test_a_target_that_underflows_to_zero_gives_the_free_beam(target: str, mechanics: str) -> None:
    """5e-324 is the least number above zero; in radians or of L it is zero."""
    pushes = f"pushes={{contact_distance_mm: [100], {target}: [5.0e-324]}}"
    file = load_scene(FIG8, settings=[pushes, f"mechanics={mechanics}"])
    push = frame_specs(file.scene)[0].push
    (state,) = Experiment(file.scene, true_rig(file.scene), push, FIG8.parent).states()
    assert state.contacts == ()
    assert state.tip == pytest.approx([0.24, 0, 0], abs=1e-15)


def test_a_hung_weight_pulls_down_in_the_world_at_every_motor_angle() -> None:
    settings = [
        "pushes={contact_distance_mm: [150], pushing_angle_deg: [0, 20, -15]}",
        "tolerances={true_rig: drawn, gravity_deg: 0.5}",
        "object={kind: weight, weight_g: 30}",
    ]
    scene = load_scene(HUNG_WEIGHT, settings=settings).scene
    specs, rig, gravity = frame_specs(scene), true_rig(scene), np.array(true_gravity(scene))
    assert 0.0 < abs(np.degrees(np.arctan2(gravity[0], -gravity[1]))) < 2.0
    for spec in specs:
        experiment = Experiment(scene, rig, spec.push, HUNG_WEIGHT.parent)
        state = experiment.states()[spec.step]
        turn = turn_about_z(spec.motor_angle(state.pushing_angle))[:3, :3]
        assert turn @ state.contact.force == pytest.approx(0.03 * gravity, abs=1e-12)
        row = truth_row(experiment, spec, state, None)
        assert row["force_n"] == pytest.approx(0.03 * 9.81, rel=1e-12)
        assert row["s_c_mm"] == pytest.approx(150.0, rel=1e-12)
        assert row["psi_deg"] == pytest.approx(0.0, abs=1e-9)
        assert row["y_c_mm"] > 1.0
        down = np.asarray(experiment.touched_mesh(state, spec.step).vertices) @ turn.T @ gravity
        hook = turn @ state.contact.point @ gravity
        low = (scene.object.thread_length_mm + scene.object.weight_height_mm) * 1e-3  # type: ignore[attr-defined]
        assert down.max() - hook == pytest.approx(9.81 * low, rel=1e-9)


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        ("gravity_m_s2=[0, 0, 0]", "gravity_m_s2 is zero"),
        ("pushes={contact_distance_mm: [150], deflection_pct: [5]}", "needs pushing_angle_deg"),
        ("second_peg={distance_mm: 200}", "second_peg is given"),
        ("motor_speed_deg_s=1", "motor_speed_deg_s is given"),
    ],
)
def test_a_weight_that_is_not_modelled_is_refused(setting: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        load_scene(HUNG_WEIGHT, settings=[setting])
