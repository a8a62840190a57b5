"""Photographs of one beam, and what the laboratory states about beam, loads and camera."""

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from solver.instrument.arrays import Floats
from solver.instrument.beam_shape import BeamShape
from solver.instrument.images import ALL_CHANNELS
from solver.instrument.units import DEGREE

KINDS: Final = ("weight", "push")
# Stated errors of photos.json that does not state them, all chosen. Angle of the view against the
# normal of the beam's plane, for a phone that is held by hand.
VIEW_SIGMA: Final = 5 * DEGREE
# A point that was clicked on.
MARK_SIGMA: Final = 1.0
# The direction of a thread against the clamp's axis, by a spirit level.
DOWN_SIGMA: Final = 0.5 * DEGREE
# Distortion of the lens. Chosen: 1.5 % of the radius in the corner of a wide image; telephones
# correct the rest.
K1_SIGMA: Final = 0.03
# A beam that is clamped again, or gives way in its clamp, from photograph to photograph.
TILT_SIGMA: Final = 1 * DEGREE


class Stated(NamedTuple):
    """A stated number with its one-sigma error."""

    value: float
    sigma: float


LENS: Final = Stated(0.0, K1_SIGMA)
DOWN: Final = Stated(-math.pi / 2, DOWN_SIGMA)


@dataclass(frozen=True)
class PhotoLoad:
    """A single force on the beam: its kind, and its size [N] and arc length [m] where known.

    The direction of a `weight` is fixed in the world; a `push` is across the beam where it touches.
    """

    kind: str
    force: Stated | None = None
    place: Stated | None = None


@dataclass(frozen=True)
class Photograph:
    """A photograph: images (2,) [px] of clamp and tip, and its load, None at rest.

    `marks` (n, 4) are the pixels u, v of n marks, and their places x, y [m] in plane C of Sigma_a;
    `ticks` (m, 4) those of m marks on the beam, with their arc length from the clamp and its sigma
    [m]. Of a beam whose tip is hidden, `tip` is the last place that is visible. `principal_point`
    (2,) [px] is None for the middle of the image.
    """

    path: Path
    clamp: Floats
    tip: Floats
    marks: Floats
    load: PhotoLoad | None = None
    ticks: Floats = field(default_factory=lambda: np.zeros((0, 4)))
    tip_hidden: bool = False
    principal_point: Floats | None = None


@dataclass(frozen=True)
class PhotoSet:
    """Photographs of one beam, with the beam's length [m] and, if known, its EI [N m^2].

    `focal` [px] is None if it is unknown; `k1` is the distortion of the lens. `down` [rad] is the
    direction of gravity in plane C, from the clamp's axis x towards y. `view_sigma` [rad] is the
    stated angle between the camera's axis and the normal of plane C about either axis, `tilt_sigma`
    [rad] that of the beam in its clamp, `mark_sigma` [px] the error of clamp, tip and marks.
    """

    photographs: tuple[Photograph, ...]
    length: Stated
    rigidity: Stated | None
    shape: BeamShape
    down: Stated = DOWN
    channel: str = ALL_CHANNELS
    focal: Stated | None = None
    k1: Stated = LENS
    view_sigma: float = VIEW_SIGMA
    mark_sigma: float = MARK_SIGMA
    tilt_sigma: float = TILT_SIGMA
