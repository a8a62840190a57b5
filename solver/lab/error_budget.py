"""What limits the estimates of a rig: the share of each stated sigma in an imagined push.

A push is imagined, with images as accurate as those of the beam at rest, and estimated with all
that rig.json states. It is estimated again without one source of errors after the other.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np

from solver.antenna import Antenna
from solver.centreline import Centreline
from solver.fitting.frame_estimate import with_bow
from solver.fitting.frame_problem import frame_problem_of
from solver.instrument.arrays import Floats
from solver.instrument.rig_json import sigma_keys, without_errors
from solver.instrument.transforms import apply
from solver.instrument.units import MILLIMETRE
from solver.learning.next_push import imagined_push, points_of_push
from solver.methods.exact_fit import exact_fit
from solver.to_measurement import to_measurement
from solver.uniform.problem import problem_of

# The push: the contact's arc length and the tip's deflection, over the length. Chosen: a usual one.
PLACE, DEFLECTION = 0.6, 0.1
# Sources with a smaller share of a variance are not listed. Chosen: a tenth of it adds 5 % to a
# sigma.
LEAST_SHARE: Final = 0.1
BOW, CALIBRATION, IMAGE = "bow at rest", "calibration", "image"


class Share(NamedTuple):
    """Source of errors, a key of rig.json or another, and its shares of the variances."""

    source: str
    of_x_c: float
    of_force: float


class ErrorBudget(NamedTuple):
    """Sigma of the contact distance [mm] and relative sigma of the force [%] in a usual push.

    Each of `shares` is that by which a variance falls if the source had no error; that of the image
    is what is left if all others had none. Sources may add up to less than 1, or more: what one of
    them leaves open another may determine.
    """

    x_c_sigma_mm: float
    force_sigma_pct: float
    shares: tuple[Share, ...]

    @property
    def text(self) -> str:
        """Format as a few lines of text."""
        push = f"contact at {PLACE:.0%} of the length, tip deflected by {DEFLECTION:.0%}"
        shares = ((one.source, one.of_x_c, one.of_force) for one in self.shares)
        return "\n".join(
            (
                f"x_c +- {self.x_c_sigma_mm:.2g} mm, force +- {self.force_sigma_pct:.2g} %, for a "
                f"{push};",
                "each error's share of the variances of x_c and of the force:",
                *(f"{x_c:4.0%} {force:4.0%}  {source}" for source, x_c, force in shares),
            )
        )


def error_budget(antenna: Antenna) -> ErrorBudget | None:
    """Compute the error budget of a rig; None where an imagined push is not estimated."""
    line = _imagined(antenna)
    whole = None if line is None else _sigmas(antenna, line)
    if line is None or whole is None:
        return None
    keys = sigma_keys(antenna.rig)
    shares = [
        # A prior is not quite linear: without one source, another may count for more.
        Share(source, *np.maximum(1 - (part / whole) ** 2, 0.0).tolist())
        for source, other in _without_sources(antenna, keys)
        if (part := _sigmas(other, line)) is not None
    ]
    exact = _without_calibration(_without_bow(_without(antenna, *keys)))
    if (left := _sigmas(exact, line)) is not None:
        shares.append(Share(IMAGE, *((left / whole) ** 2).tolist()))
    listed = [one for one in shares if max(one.of_x_c, one.of_force) >= LEAST_SHARE]
    listed.sort(key=lambda one: -max(one.of_x_c, one.of_force))
    x_c_sigma, force_sigma = whole.tolist()
    return ErrorBudget(x_c_sigma / MILLIMETRE, 100 * force_sigma, tuple(listed))


def _without_sources(antenna: Antenna, keys: Sequence[str]) -> Iterator[tuple[str, Antenna]]:
    """Yield each source of errors, and the antenna without it."""
    for key in keys:
        yield key, _without(antenna, key)
    yield BOW, _without_bow(antenna)
    yield CALIBRATION, _without_calibration(antenna)


def _without(antenna: Antenna, *keys: str) -> Antenna:
    return replace(antenna, rig=without_errors(antenna.rig, keys))


def _without_bow(antenna: Antenna) -> Antenna:
    """Return the antenna whose bow at rest is known exactly."""
    known = replace(antenna.rest.without_bow(), bow=antenna.rest.bow)
    return replace(antenna, at_rest=replace(antenna.at_rest, line=known))


def _without_calibration(antenna: Antenna) -> Antenna:
    return replace(antenna, clamp_sigma=0.0, scale_sigma=0.0)


def _sigmas(antenna: Antenna, line: Centreline) -> Floats | None:
    """Estimate from a line; return the sigma of x_c [m] and the relative one of the force (2,)."""
    estimate = exact_fit(to_measurement(antenna, line))
    if not estimate.values:
        return None
    force = abs(estimate.values["force_n"])
    return np.array([estimate.sigma("x_c_m"), estimate.sigma("force_n") / force])


def _imagined(antenna: Antenna) -> Centreline | None:
    """Imagine the centreline of a push; None for a beam that cannot be bent in this way."""
    length = antenna.rig.beam.length
    count = int(length / antenna.pixel)
    x = np.linspace(0.02 * length, length, count)
    at_rest = with_bow(to_measurement(antenna, _line(antenna, x, antenna.rest.bow_at(x)[0])))
    model = frame_problem_of(at_rest, problem_of(at_rest, with_tip=False))
    points = points_of_push(model, imagined_push(model, PLACE, DEFLECTION))
    return None if points is None else _line(antenna, *(length * points[:2]))


def _line(antenna: Antenna, x: Floats, y: Floats) -> Centreline:
    """Return the centreline of points x, y (n,) [m] in the frame of the beam at rest."""
    places = np.column_stack([x, y, np.zeros_like(x)])
    pixels = antenna.calibration.camera.project(apply(antenna.antenna_from_beam, places))
    u, v = np.abs(np.ptp(pixels, axis=0))
    across = [0.0, 1.0] if u >= v else [1.0, 0.0]
    sigma = np.full(len(x), antenna.at_rest.sigma_px)
    return Centreline(pixels, np.tile(across, (len(x), 1)), sigma)
