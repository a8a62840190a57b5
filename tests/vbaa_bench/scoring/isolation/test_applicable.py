from dataclasses import replace
from pathlib import Path

from solver.instrument.image_frame import ImageFrame
from solver.instrument.observation import Observations
from solver.instrument.rig import Gravity, Sensors
from solver.methods import METHODS
from tests.simulated import rig
from vbaa_bench.scoring.isolation.runs import applicable


def observations(
    tmp: str, sensors: Sensors, pushes: list[str], gravity: Gravity | None = None
) -> Observations:
    frames = tuple(ImageFrame(str(i), Path(tmp), push_id=push) for i, push in enumerate(pushes))
    return Observations(Path(tmp), replace(rig(), sensors=sensors, gravity=gravity), (), (), frames)


def test_methods_without_readings_are_left_out() -> None:
    visual = applicable(observations(".", Sensors(), ["a", "b"]))
    of_pushes = {"stiffness", "push_fit", "push_fit_friction"}
    # No frame is for learning, and no weight hangs from the beam.
    learning, hung = {"exact_fit_learned"}, {"hung_weight"}
    never = {"moment_sensor", "force_sensor"} | learning | hung
    assert set(METHODS) - set(visual) == never | of_pushes
    pushed = applicable(observations(".", Sensors(), ["a", "a"]))
    assert set(METHODS) - set(pushed) == never
    every = Sensors(moment_y=1e-4, base_force=1e-3, base_moment=1e-4)
    assert applicable(observations(".", every, ["a", "a"], Gravity(1.5))) == [
        name for name in METHODS if name not in learning
    ]
