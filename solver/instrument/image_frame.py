"""One image of a pushing beam, with the readings taken with it."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from solver.instrument.arrays import Grey
from solver.instrument.errors import InputError
from solver.instrument.images import read_channels
from solver.instrument.units import DEGREE, MILLIMETRE

# Name of the split from which a beam is learned.
LEARN: Final = "learn"


@dataclass(frozen=True)
class Carriage:
    """Pose of Sigma_o on the table of the object: x, y [m] and turn about z [rad].

    `position_sigma` [m] is the standard deviation of each coordinate, `turn_sigma` [rad] that of
    the turn. Raises InputError unless all are finite numbers, and the sigmas not negative.
    """

    x: float
    y: float
    turn: float
    position_sigma: float = 0.0
    turn_sigma: float = 0.0

    def __post_init__(self) -> None:
        pose, sigmas = (self.x, self.y, self.turn), (self.position_sigma, self.turn_sigma)
        if not all(math.isfinite(value) for value in (*pose, *sigmas)) or min(sigmas) < 0:
            raise InputError(
                f"the carriage is at {pose} with the sigmas {sigmas}, allowed are finite numbers "
                "and sigmas that are not negative"
            )

    @classmethod
    def at(
        cls,
        x_mm: float,
        y_mm: float,
        turn_deg: float,
        sigma_mm: float = 0.0,
        turn_sigma_deg: float = 0.0,
    ) -> "Carriage":
        """Make a carriage of its readings. Raises InputError."""
        mm = MILLIMETRE
        return cls(x_mm * mm, y_mm * mm, turn_deg * DEGREE, sigma_mm * mm, turn_sigma_deg * DEGREE)


@dataclass(frozen=True)
class Readings:
    """Readings that belong to an image; each is None if it does not exist.

    `motor_angle` [rad] is the encoder's reading. `removed` [m] is an interval of Sigma_a's x axis
    to be left out. `moment_y` [N m], `base_force` (3,) [N] and `base_moment` (3,) [N m] are sensor
    readings. `carriage` is the pose of an antenna that is carried about its object. Raises
    InputError if a sensor's reading is not finite.
    """

    motor_angle: float | None = None
    removed: tuple[float, float] | None = None
    moment_y: float | None = None
    base_force: tuple[float, float, float] | None = None
    base_moment: tuple[float, float, float] | None = None
    carriage: Carriage | None = None

    def __post_init__(self) -> None:
        sensors = {
            "motor_angle": (self.motor_angle,),
            "moment_y": (self.moment_y,),
            "base_force": self.base_force or (),
            "base_moment": self.base_moment or (),
        }
        for name, values in sensors.items():
            if not all(value is None or math.isfinite(value) for value in values):
                raise InputError(f"the reading {name} is {values}, allowed are finite numbers")
        if not isinstance(self.carriage, Carriage | None):
            raise InputError(f"the carriage is {self.carriage!r}, allowed is a solver.Carriage")


NO_READINGS = Readings()


@dataclass(frozen=True)
class ImageFrame:
    """One image of the pushing beam: its path and the readings taken with it.

    Frames of one push share `push_id` and are ordered by `step`. `channel` is the channel read from
    a colour image, or "all". `split` is the part of the set to which the frame belongs; the beam is
    learned from the part "learn".
    """

    frame_id: str
    path: Path
    readings: Readings = NO_READINGS
    push_id: str = ""
    step: int = 0
    channel: str = "gray"
    split: str = ""

    def image(self) -> Grey:
        """Read the image (height, width), or (height, width, 3) of all channels.

        Raises InputError.
        """
        return read_channels(self.path, self.channel)


def push_order(frames: Sequence[ImageFrame]) -> list[int]:
    """Sort the indices of frames by push, in the order of their first frames, then by step."""
    first = {frame.push_id: i for i, frame in reversed(list(enumerate(frames)))}
    return sorted(range(len(frames)), key=lambda i: (first[frames[i].push_id], frames[i].step))
