from dataclasses import replace
from pathlib import Path

from solver.instrument.image_frame import ImageFrame
from solver.instrument.observation import Observations
from solver.instrument.rig import Sensors
from solver.methods import METHODS
from tests.simulated import rig
from vbaa_bench.scoring.applicable import applicable


def observations(tmp: str, sensors: Sensors, pushes: list[str]) -> Observations:
    frames = tuple(ImageFrame(str(i), Path(tmp), push_id=push) for i, push in enumerate(pushes))
    return Observations(Path(tmp), replace(rig(), sensors=sensors), (), (), frames)


def test_methods_without_readings_are_left_out() -> None:
    visual = applicable(observations(".", Sensors(), ["a", "b"]))
    of_pushes = {"stiffness", "push_fit", "push_fit_friction"}
    learning = {"exact_fit_learned"}  # no frame is for learning
    assert set(METHODS) - set(visual) == {"moment_sensor", "force_sensor"} | of_pushes | learning
    pushed = applicable(observations(".", Sensors(), ["a", "a"]))
    assert set(METHODS) - set(pushed) == {"moment_sensor", "force_sensor"} | learning
    every = Sensors(moment_y=1e-4, base_force=1e-3, base_moment=1e-4)
    assert applicable(observations(".", every, ["a", "a"])) == [
        name for name in METHODS if name not in learning
    ]
