"""Rungs from the paper's method to the whole solver: each is an antenna and a method.

The lower rungs switch off what a later one adds. They are no part of the solver.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np

from solver.antenna import Antenna
from solver.at_rest.rest_line import RestLine
from solver.baselines.linear_fit import linear_fit
from solver.baselines.two_point import contact_distance, two_point
from solver.centreline.extractors import EXTRACTORS
from solver.fitting.uniform_estimate import uniform_estimate
from solver.instrument.estimate import Estimate, Outcome
from solver.instrument.measurement import Measurement
from solver.instrument.observation import Observations
from solver.instrument.rig import Rig
from solver.methods import Method
from solver.methods.exact_fit import exact_fit
from solver.set_up import set_up

# Name of the last rung, which is no method.
LIMIT: Final = "information limit"


class Rung(NamedTuple):
    """A step of the ladder: its name, and how it estimates."""

    name: str
    antenna: Antenna
    method: Method


def rungs_of(observations: Observations) -> Sequence[Rung]:
    """List the rungs of a dataset from the lowest one, each with all that those before it have.

    Raises InputError if the images do not allow a set-up.
    """
    paper = without_nuisances(set_up(observations, EXTRACTORS["area_weighted"]))
    profile = set_up(observations)
    fixed = without_nuisances(profile)
    unlit = replace(profile, rig=without_light(profile.rig))
    return (
        Rung("the paper's method", paper, every_pair),
        Rung("misprints mended", paper, two_point),
        Rung("sub-pixel profile", fixed, two_point),
        Rung("all columns at once", fixed, linear_fit),
        Rung("exact beam", fixed, exact_beam),
        Rung("clamp, calibration", unlit, exact_beam),
        Rung("light", profile, exact_fit),
    )


def without_light(rig: Rig) -> Rig:
    """Return a rig whose light comes from the camera: the beam's bright line is its axis."""
    return replace(rig, light=replace(rig.light, slope=0.0, slope_sigma=0.0, distance=None))


def without_nuisances(antenna: Antenna) -> Antenna:
    """Return an antenna whose clamp is exactly where rig.json states it, and has no shading.

    The rest images then give neither pose nor bow, and the calibration has no error.
    """
    rig = antenna.rig
    tolerances = replace(
        rig.tolerances, base_position=0.0, board_translation=0.0, board_rotation=0.0
    )
    stated = RestLine(
        y_at_clamp=float(rig.base_position[1]),
        slope=0.0,
        bow=np.zeros(3),
        covariance=np.zeros((5, 5)),
        length=antenna.rest.length,
    )
    at_rest = replace(antenna.at_rest, line=stated)
    exact = replace(without_light(rig), tolerances=tolerances)
    return replace(antenna, rig=exact, at_rest=at_rest, clamp_sigma=0.0, scale_sigma=0.0)


def every_pair(measurement: Measurement) -> Estimate:
    """Average the contact distance over all pairs of image columns, as the paper reads.

    A pair has three candidates, (15), (19) and (20), each with a condition. The one that meets its
    condition counts: at most one does, and it is the root of the monotone ratio. (18) as printed is
    not a force.
    """
    ahead = measurement.points[measurement.points[:, 0] > 0]
    x, y = ahead[np.argsort(ahead[:, 0], kind="stable")].T
    first, second = np.triu_indices(len(x), 1)
    x_c = contact_distance(x[first], y[first], x[second], y[second])
    valid = x_c[x_c <= measurement.rig.beam.length]
    if not len(valid):
        return Estimate(Outcome.INVALID, "no pair has a contact on the beam")
    return Estimate(Outcome.CONTACT, values={"x_c_m": float(valid.mean())})


def exact_beam(measurement: Measurement) -> Estimate:
    """Fit the exact beam in closed form; no other beam is tried where it does not fit."""
    return uniform_estimate(measurement).estimate
