"""Which of the solver's methods a dataset has the readings for."""

from solver.instrument.observation import Observations
from solver.methods import METHODS


def applicable(observations: Observations) -> list[str]:
    """Names of METHODS, without those that need a sensor or a sequence that is not there."""
    sensors = observations.rig.sensors
    pushes = [frame.push_id for frame in observations]
    lacking = set()
    if sensors.moment_y is None:
        lacking.add("moment_sensor")
    if sensors.base_force is None:
        lacking.add("force_sensor")
    if len(set(pushes)) == len(pushes):
        lacking |= {"stiffness", "push_fit", "push_fit_friction"}
    return [name for name in METHODS if name not in lacking]
