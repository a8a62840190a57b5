"""Score of a set of real images against what its balance and ruler know."""

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Final, NamedTuple

import numpy as np

from solver.antenna import Antenna
from solver.instrument.errors import InputError
from solver.instrument.estimate import Estimate, Outcome
from solver.instrument.rig import Rig
from solver.instrument.units import MILLIMETRE
from solver.lab.findings import Finding
from solver.lab.protocol import KNOWN, KnownLoad, Load, Protocol
from solver.methods import Method
from solver.methods.exact_fit import exact_fit
from solver.methods.hung_weight import hung_weight
from solver.tracker import PushTracker

# Mean gravity [m/s^2] and its sigma on the ground. Derived: 9.780 at the equator, 9.832 at a pole,
# evenly distributed between them.
GRAVITY, GRAVITY_SIGMA = 9.806, 0.015
# Deviations above this number of combined sigmas are named as mistakes of a row. Chosen: a decimal
# point or another row is far above, and noise exceeds it once in two million values.
MISTAKE: Final = 5.0
# Largest deviation of a consistent estimate, in combined sigmas. Chosen: noise alone exceeds it
# once in 370 values.
CONSISTENT: Final = 3.0
# The methods of the check.
USUAL_METHODS: Final[Mapping[Load, Method]] = {"push": exact_fit, "weight": hung_weight}


class Comparison(NamedTuple):
    """A quantity of an image as it is known and as it is estimated, in the unit of its name.

    `estimated` is None if the method does not estimate it, and `estimated_sigma` if the estimate
    has no covariance.
    """

    file_name: str
    load: Load
    quantity: str
    known: float
    known_sigma: float
    estimated: float | None
    estimated_sigma: float | None

    @property
    def deviation(self) -> float | None:
        """The difference over its sigma, which includes that of the balance or the ruler."""
        if self.estimated is None or self.estimated_sigma is None:
            return None
        return (self.estimated - self.known) / math.hypot(self.known_sigma, self.estimated_sigma)


def solve_known(
    protocol: Protocol, antenna: Antenna, load: Load, method: Method
) -> Iterator[tuple[KnownLoad, Estimate]]:
    """Estimate every load of a kind with a method. Any failure is an outcome."""
    for known in protocol.known:
        if known.load != load:
            continue
        try:
            frame = protocol.frames[known.file_name]
            solution = PushTracker(antenna, method).solve(frame.image(), frame.readings)
            yield known, solution.estimate
        except (InputError, KeyError) as error:
            message = str(error) if isinstance(error, InputError) else "metadata.csv has no row"
            yield known, Estimate(Outcome.INVALID, message)


def compare(load: KnownLoad, estimate: Estimate, rig: Rig) -> list[Comparison]:
    """Compare what balance and ruler know of a load with its estimate.

    A weight's force is along gravity; of a push, a balance shows the part along gravity.
    """
    place = "s_c_mm" if load.load == "weight" else "x_c_mm"
    distance: float | None = getattr(estimate, place)
    has_sigma = distance is not None and estimate.covariance is not None
    found = [
        Comparison(
            load.file_name,
            load.load,
            place,
            load.distance / MILLIMETRE,
            load.distance_sigma / MILLIMETRE,
            distance,
            estimate.sigma(place) if has_sigma else None,
        )
    ]
    if load.mass is not None and rig.gravity is not None:
        weight = load.mass * GRAVITY
        weight_sigma = math.hypot(load.mass_sigma * GRAVITY, load.mass * GRAVITY_SIGMA)
        force = _force_along(estimate, rig.gravity.direction)
        found.append(Comparison(load.file_name, load.load, "force_n", weight, weight_sigma, *force))
    return found


class _Force(NamedTuple):
    """Component of an estimated force [N] and its sigma, as far as they are known."""

    value: float | None = None
    sigma: float | None = None


def _force_along(estimate: Estimate, direction: float) -> _Force:
    """Compute the size of the force's component along a direction [rad] in plane C."""
    names = list(estimate.values)
    if not {"force_x_n", "force_y_n"} <= set(names):
        return _Force()
    along = np.zeros(len(names))
    along[names.index("force_x_n")] = math.cos(direction)
    along[names.index("force_y_n")] = math.sin(direction)
    value = abs(float(along @ np.array(list(estimate.values.values()))))
    if estimate.covariance is None:
        return _Force(value)
    return _Force(value, math.sqrt(max(float(along @ estimate.covariance @ along), 0.0)))


class Score(NamedTuple):
    """Errors of one quantity, such as the force, in all loads of a kind.

    `n_loads` loads have a known value, and `answered_pct` of them an estimate. `error_pct` is the
    median error of these, of the known value for a force and of the beam's length for a place;
    `known_pct` is what balance or ruler leave of it, the median sigma. `rms_deviation` is 1 if all
    sigmas are right; `within_3_sigma_pct` is the share of deviations that are consistent. What
    cannot be computed is None: errors without estimates, deviations without sigmas.
    """

    load: Load
    quantity: str
    n_loads: int
    answered_pct: float
    error_pct: float | None
    known_pct: float
    rms_deviation: float | None
    within_3_sigma_pct: float | None


def scores(comparisons: Sequence[Comparison], rig: Rig) -> list[Score]:
    """Score estimates against balance and ruler, per kind of load and quantity."""
    found = []
    for load, quantity in dict.fromkeys((one.load, one.quantity) for one in comparisons):
        ours = [one for one in comparisons if (one.load, one.quantity) == (load, quantity)]
        length = rig.beam.length / MILLIMETRE
        units = [one.known if quantity == "force_n" else length for one in ours]
        errors = [
            abs(one.estimated - one.known) / unit
            for one, unit in zip(ours, units, strict=True)
            if one.estimated is not None
        ]
        known_sigmas = np.array([one.known_sigma for one in ours]) / units
        deviations = np.array([one.deviation for one in ours if one.deviation is not None])
        consistent = np.abs(deviations) <= CONSISTENT
        found.append(
            Score(
                load,
                quantity,
                len(ours),
                100 * len(errors) / len(ours),
                100 * float(np.median(errors)) if errors else None,
                100 * float(np.median(known_sigmas)),
                float(np.sqrt(np.mean(deviations**2))) if len(deviations) else None,
                100 * float(np.mean(consistent)) if len(deviations) else None,
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
        if one.deviation is not None and abs(one.deviation) > MISTAKE:
            yield Finding(
                "contradicted",
                f"{one.file_name}: {one.quantity} is {one.known:.4g} +- {one.known_sigma:.2g} by "
                f"{KNOWN} and {one.estimated:.4g} +- {one.estimated_sigma:.2g} by the image: check "
                "the row, and what touches the beam",
            )
