"""Score of a set of real images against what its balance and ruler know."""

import math
from collections.abc import Iterator, Sequence
from typing import Final, NamedTuple

import numpy as np

from solver.antenna import Antenna
from solver.instrument.errors import InputError
from solver.instrument.estimate import Estimate, Outcome
from solver.instrument.rig import Rig
from solver.instrument.units import MILLIMETRE
from solver.lab.findings import Finding
from solver.lab.protocol import KNOWN, KnownLoad, Load, Protocol
from solver.methods.exact_fit import exact_fit
from solver.methods.hung_weight import hung_weight
from solver.tracker import PushTracker

# Mean gravity [m/s^2] and its sigma on the ground. Derived: 9.780 at the equator, 9.832 at a pole,
# evenly distributed between them.
GRAVITY, GRAVITY_SIGMA = 9.806, 0.015
# Deviations above this number of combined sigmas are named as mistakes of a row. Chosen: a decimal
# point or another row is far above, and noise exceeds it once in two million values.
MISTAKE: Final = 5.0


class Comparison(NamedTuple):
    """A quantity of an image as it is known and as it is estimated, in the unit of its name."""

    file_name: str
    load: Load
    quantity: str
    known: float
    known_sigma: float
    estimated: float
    estimated_sigma: float

    @property
    def deviation(self) -> float:
        """The difference over its sigma, which includes that of the balance or the ruler."""
        return (self.estimated - self.known) / math.hypot(self.known_sigma, self.estimated_sigma)


def solve_known(protocol: Protocol, antenna: Antenna) -> Iterator[tuple[KnownLoad, Estimate]]:
    """Estimate every load: a push with exact_fit, a weight with hung_weight.

    Any failure is an outcome.
    """
    for load in protocol.known:
        tracker = PushTracker(antenna, exact_fit if load.load == "push" else hung_weight)
        try:
            frame = protocol.frames[load.file_name]
            yield load, tracker.solve(frame.image(), frame.readings).estimate
        except (InputError, KeyError) as error:
            message = str(error) if isinstance(error, InputError) else "metadata.csv has no row"
            yield load, Estimate(Outcome.INVALID, message)


def compare(load: KnownLoad, estimate: Estimate, rig: Rig) -> list[Comparison]:
    """Compare what balance and ruler know of a load with its estimate, as far as it has values.

    A weight's force is along gravity; of a push, a balance shows the part along gravity.
    """
    covariance, values = estimate.covariance, estimate.values
    if covariance is None:
        return []
    place = "s_c_mm" if load.load == "weight" else "x_c_mm"
    found = []
    if (distance := getattr(estimate, place)) is not None:
        known = load.distance / MILLIMETRE, load.distance_sigma / MILLIMETRE
        found.append(
            Comparison(load.file_name, load.load, place, *known, distance, estimate.sigma(place))
        )
    if load.mass is None or rig.gravity is None or "force_x_n" not in values:
        return found
    names = list(values)
    along = np.zeros(len(names))
    along[names.index("force_x_n")] = math.cos(rig.gravity.direction)
    along[names.index("force_y_n")] = math.sin(rig.gravity.direction)
    force = abs(float(along @ np.array(list(values.values()))))
    sigma = math.sqrt(max(float(along @ covariance @ along), 0.0))
    weight = load.mass * GRAVITY
    weight_sigma = math.hypot(load.mass_sigma * GRAVITY, load.mass * GRAVITY_SIGMA)
    found.append(
        Comparison(load.file_name, load.load, "force_n", weight, weight_sigma, force, sigma)
    )
    return found


class Score(NamedTuple):
    """Errors of one quantity, such as the force, in all loads of a kind.

    `n_loads` loads were compared. `error_pct` is the median error, of the known value for a force
    and of the beam's length for a place; `known_pct` is what balance or ruler leave of it, the
    median sigma. `rms_deviation` is 1 if all sigmas are right.
    """

    load: Load
    quantity: str
    n_loads: int
    error_pct: float
    known_pct: float
    rms_deviation: float


def scores(comparisons: Sequence[Comparison], rig: Rig) -> list[Score]:
    """Score estimates against balance and ruler, per kind of load and quantity."""
    found = []
    for load, quantity in dict.fromkeys((one.load, one.quantity) for one in comparisons):
        ours = [one for one in comparisons if (one.load, one.quantity) == (load, quantity)]
        known, known_sigma, estimated = np.array(
            [(one.known, one.known_sigma, one.estimated) for one in ours]
        ).T
        unit = known if quantity == "force_n" else rig.beam.length / MILLIMETRE
        found.append(
            Score(
                load,
                quantity,
                len(ours),
                100 * float(np.median(np.abs(estimated - known) / unit)),
                100 * float(np.median(known_sigma / unit)),
                float(np.sqrt(np.mean([one.deviation**2 for one in ours]))),
            )
        )
    return found


def mistakes(
    answers: Sequence[tuple[KnownLoad, Estimate]], comparisons: Sequence[Comparison]
) -> Iterator[Finding]:
    """List loads without an estimate, and loads that their images contradict."""
    for load, estimate in answers:
        if not estimate.outcome.has_values:
            message = estimate.message or estimate.outcome.sentence
            yield Finding("no_estimate", f"{load.file_name}: {estimate.outcome}: {message}")
    for one in comparisons:
        if abs(one.deviation) > MISTAKE:
            yield Finding(
                "contradicted",
                f"{one.file_name}: {one.quantity} is {one.known:.4g} +- {one.known_sigma:.2g} by "
                f"{KNOWN} and {one.estimated:.4g} +- {one.estimated_sigma:.2g} by the image: check "
                "the row, and what touches the beam",
            )
