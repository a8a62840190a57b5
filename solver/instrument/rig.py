"""The nominal rig: the laboratory's values for its antenna, with tolerances.

Tolerances are one-sigma; methods use them as priors. The rig is stored as `rig.json`, with units in
the keys; all values in memory are in SI units.
"""

import math
from dataclasses import dataclass, field

import numpy as np

from solver.instrument.arrays import Floats, freeze
from solver.instrument.beam import Beam
from solver.instrument.beam_shape import UNIFORM, BeamShape
from solver.instrument.board import Board

# Chosen far beyond any antenna, from a nanotube to a mast: only mistakes in the unit or in typing
# are rejected, and no product of these values overflows.
SIZES_MM = (1e-6, 1e6)
MAX_POSITION_MM = 1e6
RIGIDITIES_N_MM2 = (1e-18, 1e18)
# Slopes of the light where rig.json does not state them. Chosen: lamps within 17 degrees.
ANY_LIGHT = 0.3
MAX_LIGHT_SLOPE = 10.0  # light that grazes the beam at six degrees
# Chosen as SIZES_MM, a million beams away at most.
LIGHT_DISTANCES_MM = (1e-6, 1e12)
MAX_SHIFT_PX = 10.0  # a camera that shifts by more from frame to frame is not fixed


@dataclass(frozen=True)
class Tolerances:
    """One-sigma tolerances: lengths [m], angles [rad], flexural rigidity [N m^2].

    `camera_shift_px` [px] is the undetected shift of the image from frame to frame; `tip` [m] is
    how far the apparent end of the bent beam may be from that of the beam at rest.
    """

    beam_length: float
    flexural_rigidity: float
    base_position: float
    board_translation: float
    board_rotation: float
    encoder: float
    camera_shift_px: float = 0.0
    tip: float = 0.0


@dataclass(frozen=True)
class Sensors:
    """One-sigma noise of the sensors at the clamp; None if there is no such sensor.

    `moment_y` [N m] applies to the moment about Sigma_a's y axis (section V-C); `base_force` [N]
    and `base_moment` [N m] apply to every component of the clamp's force and moment on the beam.
    """

    moment_y: float | None = None
    base_force: float | None = None
    base_moment: float | None = None


@dataclass(frozen=True)
class Light:
    """Direction of the light: tangents of the angle from the beam between light and camera.

    `slope` is the tangent along the beam, at its middle, positive where the light comes from the
    tip's side: 0 for a ring about the lens; `slope_sigma` is its sigma. `distance` [m] is the
    distance of a small lamp from plane C whose direction changes as much along the beam; None if
    the light is as far away as the camera. `across` is the root mean square of the tangent across
    the beam.
    """

    slope: float = 0.0
    slope_sigma: float = ANY_LIGHT
    distance: float | None = None
    across: float = ANY_LIGHT


@dataclass(frozen=True)
class Gravity:
    """Direction of gravity in plane C, along which a hung weight pulls, and its sigma [rad].

    `direction` is the angle in Sigma_o from x towards y. Raises ValueError if a value is not finite
    or the sigma is negative.
    """

    direction: float
    sigma: float = 0.0

    def __post_init__(self) -> None:
        if not (math.isfinite(self.direction) and 0 <= self.sigma < math.inf):
            raise ValueError(f"gravity is {self.direction} +- {self.sigma}, allowed is finite")


@dataclass(frozen=True)
class ClampOffset:
    """Position (2,) [m] of the clamp relative to the motor's axis, in x and y of Sigma_a.

    `covariance` (2, 2) [m^2] is its uncertainty. By default the clamp is on the axis (the paper's
    assumption 4). Raises ValueError if a shape is wrong or a value is not finite.
    """

    position: Floats = field(default_factory=lambda: np.zeros(2))
    covariance: Floats = field(default_factory=lambda: np.zeros((2, 2)))

    def __post_init__(self) -> None:
        freeze(self, "position", (2,), "clamp offset")
        freeze(self, "covariance", (2, 2), "covariance of the clamp offset")

    @property
    def none(self) -> bool:
        """Whether the clamp is certainly on the axis."""
        return not (self.position.any() or self.covariance.any())


@dataclass(frozen=True)
class Rig:
    """Nominal beam, clamp position (3,) [m] in Sigma_a, board of view 0, its pose, tolerances.

    `deflects_towards` is +1 or -1: the side of Sigma_a's y axis to which contact bends the beam.
    `telecentric` is False for a pinhole camera. `distortion_coefficients` is the number of
    coefficients of the lens (0, 5 or 8). `camera_mount` is "antenna" if the camera moves with the
    antenna, "world" if it is fixed; then Sigma_a is that of the rest images. `known_psi` [rad] is
    the inclination of the only plane in which a flat strip bends; None for a round beam. `sag` [m]
    is the distance of the tip at rest below plane C due to the beam's weight; `sag_in_plane` (2,)
    [m] is that within plane C, as a vector in Sigma_o along the weight, were it across the beam.
    `light` is its direction. `bits` is the
    camera's bit depth, None if it is found from the images. `channel` is the channel read from a
    colour image. `shape` is how the beam differs from a uniform one, as stated or learned.
    `gravity` is its direction, which a hung weight needs; None if it is not stated. `clamp_offset`
    is the clamp's position relative to the motor's axis.
    """

    beam: Beam
    base_position: Floats
    board: Board
    antenna_from_board: Floats
    deflects_towards: int
    tolerances: Tolerances
    telecentric: bool = False
    camera_mount: str = "antenna"
    known_psi: float | None = None
    sensors: Sensors = Sensors()
    distortion_coefficients: int = 0
    sag: float = 0.0
    sag_in_plane: Floats = field(default_factory=lambda: np.zeros(2))
    light: Light = Light()
    bits: int | None = None
    channel: str = "gray"
    shape: BeamShape = UNIFORM
    gravity: Gravity | None = None
    clamp_offset: ClampOffset = ClampOffset()

    @property
    def free_length(self) -> float:
        """Length [m] of the beam from where it begins to bend to its tip."""
        return self.beam.length * (1 - self.shape.clamp_shift)

    def __post_init__(self) -> None:
        freeze(self, "base_position", (3,))
        freeze(self, "antenna_from_board", (4, 4))
        freeze(self, "sag_in_plane", (2,))
