"""Methods, one per file: each converts a measurement to an estimate."""

from collections.abc import Callable
from typing import Final

from solver.baselines.force_sensor import force_sensor
from solver.baselines.linear_fit import linear_fit
from solver.baselines.moment_sensor import moment_sensor
from solver.baselines.stiffness import stiffness
from solver.baselines.three_point import three_point
from solver.baselines.two_point import two_point
from solver.instrument.estimate import Estimate
from solver.instrument.measurement import Measurement
from solver.methods.exact_fit import exact_fit
from solver.methods.exact_fit_3d import exact_fit_3d
from solver.methods.exact_fit_learned import exact_fit_learned
from solver.methods.hung_weight import hung_weight
from solver.methods.push_fit import push_fit, push_fit_friction
from solver.methods.two_contact_fit import two_contact_fit

Method = Callable[[Measurement], Estimate]

# The paper's methods; least squares with linear theory; the exact beam; the conventional antenna.
METHODS: Final[dict[str, Method]] = {
    "two_point": two_point,
    "three_point": three_point,
    "moment_sensor": moment_sensor,
    "stiffness": stiffness,
    "linear_fit": linear_fit,
    "exact_fit": exact_fit,
    "exact_fit_3d": exact_fit_3d,
    "exact_fit_learned": exact_fit_learned,
    "two_contact_fit": two_contact_fit,
    "hung_weight": hung_weight,
    "push_fit": push_fit,
    "push_fit_friction": push_fit_friction,
    "force_sensor": force_sensor,
}
# Those for which the beam is learned before the first frame.
LEARNING: Final = frozenset({"exact_fit_learned"})
