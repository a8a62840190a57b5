"""Selection of the solver's methods for which a dataset has the readings."""

from solver.instrument.image_frame import LEARN
from solver.instrument.observation import Observations
from solver.methods import LEARNING, METHODS


def applicable(observations: Observations) -> list[str]:
    """List the names of METHODS for which all is there: sensors, sequences, splits, gravity."""
    sensors = observations.rig.sensors
    pushes = [frame.push_id for frame in observations]
    inapplicable = set()
    if sensors.moment_y is None:
        inapplicable.add("moment_sensor")
    if sensors.base_force is None:
        inapplicable.add("force_sensor")
    if observations.rig.gravity is None:
        inapplicable.add("hung_weight")
    if len(set(pushes)) == len(pushes):
        inapplicable |= {"stiffness", "push_fit", "push_fit_friction"}
    if all(frame.split != LEARN for frame in observations):
        inapplicable |= LEARNING
    return [name for name in METHODS if name not in inapplicable]
