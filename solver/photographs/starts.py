"""Start of a photograph's fit: the load of linear theory whose bend is nearest to the points."""

import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from solver.beams.linear import unit_deflection
from solver.instrument.arrays import Floats
from solver.photographs.joint import PLACES
from solver.photographs.photo_set import PhotoLoad, Stated
from solver.photographs.problem import OWN
from solver.photographs.view import ROLL, SCALE, U, V

# Places of a load over the length, from which a fit starts. Chosen: neighbours are in the same
# valley of the objective.
_PLACES: Final = (0.3, 0.5, 0.7, 0.9)
# A stated place is that of the load within this many sigmas. Chosen: as an answer is right.
_REACH_SIGMAS: Final = 3.0
# Least load of a start, over EI / L^2. Chosen: it bends the tip by a thousandth of the length.
_LEAST_LOAD: Final = 3e-3


def side_of(points: Floats, clamp: Floats, tip: Floats, load: PhotoLoad | None, down: float) -> int:
    """Return 1 for a beam that bends towards y of Sigma_a, and -1 for one that bends away from it.

    A weight pulls in the direction `down` [rad]. Other loads follow from the points (n, 2) [px]:
    a bent beam is on the other side of the line from clamp to tip (2,) [px].
    """
    if load is None:
        return 1
    if load.kind == "weight":
        return 1 if math.sin(down) > 0 else -1
    _, heights = _along_chord(points, clamp, tip)
    return -1 if heights.mean() > 0 else 1


def places_tried(stated: Stated | None, length: float) -> list[float]:
    """Return the places of a load over the length [m] of the beam, from which a fit starts.

    They are those that its `stated` place [m] allows.
    """
    if stated is None:
        return list(_PLACES)
    place, reach = stated.value / length, _REACH_SIGMAS * stated.sigma / length
    tried = [other for other in _PLACES if abs(other - place) < reach]
    return [float(np.clip(place, *PLACES)), *tried]


def starts_of(
    points: Floats, clamp: Floats, tip: Floats, side: int, places: Sequence[float]
) -> list[Floats]:
    """Return the photograph's own parameters (10,) of a start for each of the load's `places`.

    They are over the length; without one, there is no load.
    """
    along, heights = _along_chord(points, clamp, tip)
    chord, loaded = tip - clamp, len(places) > 0
    starts = []
    for at in places or (0.5,):
        load, slope = 0.0, 0.0
        if loaded:
            at_tip = float(unit_deflection(1.0, at)) / 6
            bend = unit_deflection(along, at) / 6 - at_tip * along
            load = max(float(bend @ (side * heights) / (bend @ bend)), _LEAST_LOAD)
            slope = math.atan(load * at_tip)
        start, view = np.zeros(len(OWN)), OWN["view"]
        start[OWN["q"]], start[OWN["s_c"]] = load, at
        start[view + U], start[view + V] = clamp
        start[view + ROLL] = math.atan2(chord[1], chord[0]) + side * slope
        start[view + SCALE] = math.log(math.hypot(*chord))
        starts.append(start)
    return starts


def _along_chord(points: Floats, clamp: Floats, tip: Floats) -> tuple[Floats, Floats]:
    """Return places (n,) along the line from clamp to tip, and heights (n,) over it, towards y.

    Both are in units of its length. In the image, y of Sigma_a is to the left of x.
    """
    chord = (tip - clamp) / (length := math.hypot(*(tip - clamp)))
    relative = (points - clamp) / length
    return relative @ chord, relative @ np.array([chord[1], -chord[0]])
