"""The keys of rig.json, each declared once: a new key is one entry of KEYS.

Reading, writing, messages (rig_json.py) and the data dictionary follow from the declaration.
"""

import math
from collections.abc import Callable
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.polynomial.legendre import legval

from solver.instrument.arrays import Floats
from solver.instrument.beam_shape import (
    BOW,
    FIRST_WIDTH,
    FRICTION_SIGMA,
    SECTION_SIGMA,
    SOFTNESS_SIGMA,
    TAPER_SIGMA,
)
from solver.instrument.board import DICTIONARIES, Charuco, Chessboard, LineNetwork
from solver.instrument.distortion import COUNTS
from solver.instrument.images import CHANNELS
from solver.instrument.keys import Keys
from solver.instrument.rig import (
    ANY_LIGHT,
    LIGHT_DISTANCES_MM,
    MAX_LIGHT_SLOPE,
    MAX_POSITION_MM,
    MAX_SHIFT_PX,
    RIGIDITIES_N_MM2,
    SIZES_MM,
)
from solver.instrument.units import DEGREE, unit_of

# Sigma of the apparent end of a bent beam where rig.json states none, in radii. Chosen: a sixth of
# a pixel on the paper's rig, where psi has three times the sigma that it has with a sharp end.
TIP_SIGMA_RADII: Final = 0.2
# Sigma of the motor angle where rig.json states none. Chosen: an angle that is set on a hobby servo
# or read from a protractor. It does not matter where no angle is read.
ENCODER_SIGMA_DEG: Final = 1.0

BOARDS: Final = {board.kind: board for board in (Chessboard, Charuco, LineNetwork)}
PROJECTIONS: Final = ("perspective", "telecentric")
_POSITIONS_MM: Final = (-MAX_POSITION_MM, MAX_POSITION_MM)
_POSITION_SIGMAS_MM: Final = (0, MAX_POSITION_MM)
_SENSOR_NOISE: Final = (1e-15, 1e6)  # noise of a sensor [N] or [N mm]
# Points per row and column of a board; OpenCV's detectors take minutes for more.
_BOARD_POINTS: Final = (3, 200)
# Chosen: a polynomial of more terms is not determined by a beam's images.
_MAX_WIDTHS: Final = 6
# Ratios and sigmas of a beam's shape. Chosen far beyond any beam that bends like one.
_MAX_RATIO: Final = 10.0
_RATIOS: Final = (0, _MAX_RATIO)
# Arc lengths over the length at which the width must be positive. Chosen: several for each term.
_PLACES: Final = np.linspace(0.0, 1.0, 101)


class Case(NamedTuple):
    """Case in which a file may have a key, which is unknown otherwise: `absent` says why."""

    holds: Callable[[Keys], bool]
    absent: str


_ALWAYS: Final = Case(lambda _keys: True, "")
_REQUIRED: Final = object()


class Key(NamedTuple):
    """Key of rig.json: its name, which ends with its unit, and its place in a rig, part.attribute.

    `limits` are the arguments of `look_up`, in the key's unit; they may depend on other keys. An
    absent key has the `default`, in SI units, or, where that is None, the attribute's own; without
    one it is required. A key is not written if it has its default and `absent` says what its
    absence means.
    """

    name: str
    place: str
    limits: tuple[Any, ...] | Callable[[Keys], tuple[Any, ...]]
    meaning: str
    frame: str = ""
    absent: str = ""
    default: Any = _REQUIRED
    look_up: Callable[..., Any] = Keys.number
    case: Case = _ALWAYS

    def is_written(self, value: Any) -> bool:
        """Return whether a file states this value, in SI units."""
        return value is not None and not (self.absent and np.array_equal(value, self.default))

    def read(self, keys: Keys) -> Any:
        """Read the value, in SI units. Raises InputError."""
        if self.default is not _REQUIRED and not keys.has(self.name):
            return self.default
        limits = self.limits(keys) if callable(self.limits) else self.limits
        value, factor = self.look_up(keys, self.name, *limits), unit_of(self.name).factor
        return value if factor == 1 else value * factor


def length_mm(keys: Keys) -> float:
    """Look up the beam's length, on which the limits of other keys depend."""
    return keys.number("beam.length_mm", *SIZES_MM)


def _up_to_length(keys: Keys) -> tuple[float, float]:
    return 0, length_mm(keys)


def _within_length(keys: Keys) -> tuple[float, float]:
    return -length_mm(keys), length_mm(keys)


def _widths(keys: Keys, name: str = "beam_shape.widths") -> Floats:
    widths = keys.numbers(name, -_MAX_RATIO, _MAX_RATIO, _MAX_WIDTHS)
    if len(widths) and (1 + _PLACES * legval(2 * _PLACES - 1, widths) <= 0).any():
        keys.refuse(name, "a width that is positive along the whole beam")
    return widths


def _bow(keys: Keys, name: str = "beam_shape.bow") -> Floats:
    bow = keys.numbers(name, -1, 1, BOW)
    if len(bow) not in (0, BOW):
        keys.refuse(name, f"a list of none or {BOW} numbers")
    return bow


def _covariance(keys: Keys, name: str, limit: float, size: int, scale: float = 0.0) -> Floats:
    """Look up a covariance (size, size); `scale` is that of its rounding, by default its trace."""
    matrix = keys.matrix(name, -limit, limit, size)
    # Twelve digits are written: eigenvalues may be negative by their rounding.
    least = -1e-9 * (scale or float(np.trace(matrix)))
    if not np.array_equal(matrix, matrix.T) or np.linalg.eigvalsh(matrix)[0] < least:
        keys.refuse(name, "a symmetric matrix without negative eigenvalues")
    return matrix


def _shape_covariance(keys: Keys, name: str) -> Floats:
    size = FIRST_WIDTH + len(_widths(keys)) + len(_bow(keys))
    return _covariance(keys, name, _MAX_RATIO**2, size, scale=_MAX_RATIO**2)


_GRAVITY: Final = Case(lambda keys: keys.has("gravity"), "no stated gravity (absent)")
_MOMENT_SENSOR: Final = Case(lambda keys: keys.has("moment_sensor"), "no sensor (absent)")
_FORCE_SENSOR: Final = Case(lambda keys: keys.has("force_sensor"), "no sensor (absent)")
_CHARUCO: Final = Case(
    lambda keys: _BOARD_KIND.read(keys) == "charuco", "the board is not charuco (absent)"
)
_LINES: Final = Case(
    lambda keys: _BOARD_KIND.read(keys) == "lines", "the board is not lines (absent)"
)
_LEARNED: Final = Case(
    lambda keys: keys.has("beam_shape.widths"), "the beam was not learned (absent)"
)
_STATED: Final = Case(
    lambda keys: not keys.has("beam_shape.widths"), "the beam was learned (absent)"
)
_MEASURED: Final = Case(
    lambda keys: not keys.has("base.clamp_offset_covariance_mm2"),
    "always; datasets state clamp_offset_covariance_mm2",
)
_A: Final = "Sigma_a"
_O: Final = "Sigma_o"
_SIGMA: Final = "standard deviation"
_ZERO: Final = "it is 0 (absent)"
_ANY: Final = f"it is {ANY_LIGHT} (absent)"
_ON_AXIS: Final = "the clamp is on the axis (absent)"
_BOARD_KIND: Final[Key] = Key(
    "board.kind", "board.kind", tuple(BOARDS), "chessboard, charuco or lines",
    default="chessboard", look_up=Keys.one_of,
)  # fmt: skip
# In the order in which they are written. Places are those of `_parts_of` in rig_json.py.
KEYS: Final = (
    Key("beam.length_mm", "beam.length", SIZES_MM, "nominal length, clamp to tip"),
    Key("beam.length_sigma_mm", "tolerances.beam_length", _up_to_length, f"{_SIGMA} of the length"),
    Key("beam.tip_sigma_mm", "tolerances.tip", _up_to_length,
        f"{_SIGMA} of the apparent end of the bent beam, less that at rest", default=None),
    Key("beam.diameter_mm", "beam.diameter", lambda keys: (SIZES_MM[0], length_mm(keys)),
        "nominal diameter"),
    Key("beam.flexural_rigidity_n_mm2", "beam.flexural_rigidity", RIGIDITIES_N_MM2, "nominal EI"),
    Key("beam.flexural_rigidity_sigma_n_mm2", "tolerances.flexural_rigidity",
        (0, RIGIDITIES_N_MM2[1]), f"{_SIGMA} of EI"),
    Key("beam.deflects_towards", "rig.deflects_towards", (1, -1),
        "side of y to which contact bends the beam: 1 or -1", _A, look_up=Keys.one_of),
    Key("beam.sag_mm", "rig.sag", _within_length,
        "distance of the tip at rest below plane C", _A, _ZERO, 0.0),
    Key("beam.sag_in_plane_mm", "rig.sag_in_plane", _within_length,
        "the same within plane C, along the weight (x, y)", _O, _ZERO, (0.0, 0.0), Keys.pair),
    Key("beam.known_psi_deg", "rig.known_psi", (-90, 90),
        "inclination of the only plane of bending", _A, "the beam is no flat strip (absent)", None),

    Key("base.position_mm", "rig.base_position", _POSITIONS_MM,
        "nominal position of the clamp (x, y, z)", _A, look_up=Keys.triple),
    Key("base.position_sigma_mm", "tolerances.base_position", _POSITION_SIGMAS_MM,
        f"{_SIGMA} of each coordinate", _A),
    Key("base.clamp_offset_mm", "clamp_offset.position", _POSITIONS_MM,
        "position of the clamp relative to the motor's axis (x, y)", _A, _ON_AXIS, None, Keys.pair),
    Key("base.clamp_offset_covariance_mm2", "clamp_offset.covariance", (MAX_POSITION_MM**2, 2),
        "covariance of this position", _A, _ON_AXIS, None, _covariance),
    Key("base.clamp_offset_sigma_mm", "clamp_offset.sigma", _POSITION_SIGMAS_MM,
        f"{_SIGMA} of each coordinate, if measured", _A, default=None, case=_MEASURED),

    _BOARD_KIND,
    Key("board.dictionary", "board.dictionary", DICTIONARIES, "dictionary of the markers",
        look_up=Keys.one_of, case=_CHARUCO),
    Key("board.line_width_mm", "board.line_width", SIZES_MM, "width of the thin lines",
        case=_LINES),
    Key("board.columns", "board.columns", _BOARD_POINTS,
        "number of inner corners or crossings per row", look_up=Keys.count),
    Key("board.rows", "board.rows", _BOARD_POINTS,
        "number of inner corners or crossings per column", look_up=Keys.count),
    Key("board.square_mm", "board.square", SIZES_MM, "spacing of these points"),
    Key("board.antenna_from_board_translation_mm", "pose.translation", _POSITIONS_MM,
        "nominal position of the pattern's middle in view 0", _A, look_up=Keys.triple),
    Key("board.antenna_from_board_rotation_vector_deg", "pose.rotation_vector", (-360, 360),
        "nominal rotation in view 0", _A, look_up=Keys.triple),
    Key("board.translation_sigma_mm", "tolerances.board_translation", _POSITION_SIGMAS_MM,
        f"{_SIGMA} of each coordinate", _A),
    Key("board.rotation_sigma_deg", "tolerances.board_rotation", (0, 180),
        f"{_SIGMA} of the rotation about each axis", _A),

    Key("encoder.sigma_deg", "tolerances.encoder", (0, 180),
        f"{_SIGMA} of the motor angle", default=ENCODER_SIGMA_DEG * DEGREE),

    Key("camera.projection", "rig.telecentric", PROJECTIONS,
        "perspective or telecentric", default=None,
        look_up=lambda keys, name, *all_: keys.one_of(name, *all_) == "telecentric"),
    Key("camera.mount", "rig.camera_mount", ("antenna", "world"),
        "antenna: turns with the motor; world: fixed", default=None, look_up=Keys.one_of),
    Key("camera.distortion_coefficients", "rig.distortion_coefficients", COUNTS,
        "number of distortion coefficients: 0, 5 or 8", default=None, look_up=Keys.one_of),
    Key("camera.camera_shift_sigma_px", "tolerances.camera_shift_px", (0, MAX_SHIFT_PX),
        f"{_SIGMA} of undetected image shifts", "image", _ZERO, 0.0),
    Key("camera.bits", "rig.bits", (8, 16),
        "bit depth of the gray values", "", "found from the images (absent)", None, Keys.count),
    Key("camera.channel", "rig.channel", CHANNELS,
        "channel read from colour images", "", "it is gray (absent)", "gray", Keys.one_of),

    Key("light.slope", "light.slope", (-MAX_LIGHT_SLOPE, MAX_LIGHT_SLOPE),
        "tangent, along the beam, between the directions to the light and to the camera",
        _A, _ZERO, None),
    Key("light.slope_sigma", "light.slope_sigma", (0, MAX_LIGHT_SLOPE),
        f"{_SIGMA} of this tangent", _A, _ANY, None),
    Key("light.distance_mm", "light.distance", LIGHT_DISTANCES_MM,
        "distance from plane C of a small lamp whose direction changes as much along the beam",
        "", "the light is as far away as the camera (absent)", None),
    Key("light.across", "light.across", (0, MAX_LIGHT_SLOPE),
        "root mean square tangent, across the beam, between these two directions",
        _A, _ANY, ANY_LIGHT),

    Key("moment_sensor.sigma_n_mm", "sensors.moment_y", _SENSOR_NOISE,
        f"{_SIGMA} of the moment", case=_MOMENT_SENSOR),
    Key("force_sensor.force_sigma_n", "sensors.base_force", _SENSOR_NOISE,
        f"{_SIGMA} of each force component", case=_FORCE_SENSOR),
    Key("force_sensor.moment_sigma_n_mm", "sensors.base_moment", _SENSOR_NOISE,
        f"{_SIGMA} of each moment component", case=_FORCE_SENSOR),

    Key("beam_shape.section_sigma", "shape.section_sigma", _RATIOS,
        f"{_SIGMA} of the section's second axis over its first, less one", default=SECTION_SIGMA),
    Key("beam_shape.friction_sigma", "shape.friction_sigma", _RATIOS,
        f"{_SIGMA} of the coefficient of friction of objects", default=FRICTION_SIGMA),
    Key("beam_shape.rigidity_sigma", "shape.rigidity_sigma", _RATIOS,
        f"relative {_SIGMA} of EI due to the section's direction", default=None),
    Key("beam_shape.rigid_objects", "shape.rigid_objects", (),
        "whether objects do not yield, and the motor only pushes on",
        "", "they may (absent)", False, Keys.flag),
    Key("beam_shape.bow_sigma_mm", "shape.bow_sigma", _up_to_length,
        f"{_SIGMA} of the tip's distance from the clamp's tangent at rest",
        "", "only the rest images show it (absent)", math.inf),
    Key("beam_shape.friction_coefficient", "shape.friction_coefficient", _RATIOS,
        "coefficient of friction of rigid objects", "", "it is not known (absent)", 0.0),
    # Of a beam of which sigmas are stated.
    Key("beam_shape.taper_sigma", "stated.taper", _RATIOS,
        f"{_SIGMA} of the tip's width over that at the clamp, less one",
        default=TAPER_SIGMA, case=_STATED),
    Key("beam_shape.clamp_softness_sigma", "stated.softness", _RATIOS,
        f"{_SIGMA} of the clamp's rotation over its moment, in units of L / EI",
        default=SOFTNESS_SIGMA, case=_STATED),
    Key("beam_shape.clamp_shift_sigma_mm", "stated.clamp_shift",
        lambda keys: (0, length_mm(keys) / 2),
        f"{_SIGMA} of where the beam begins to bend, beyond the clamp's position",
        "", _ZERO, 0.0, case=_STATED),
    # Of a learned beam.
    Key("beam_shape.widths", "learned.widths", (),
        "coefficients of the width over that at the clamp",
        look_up=_widths, case=_LEARNED),
    Key("beam_shape.clamp_softness", "learned.softness", (-_MAX_RATIO, _MAX_RATIO),
        "rotation of the clamp over its moment, in units of L / EI",
        case=_LEARNED),
    Key("beam_shape.clamp_shift", "learned.clamp_shift", (-0.5, 0.5),
        "place where the beam begins to bend, beyond the clamp's position, over the length",
        case=_LEARNED),
    Key("beam_shape.skew_rad", "learned.skew", (-1, 1),
        "angle from the plane of the force to that of the deflection, as psi",
        case=_LEARNED),
    Key("beam_shape.bow", "learned.bow", (),
        "coefficients of s^2, s^3, s^4 of the line at rest, over the length",
        look_up=_bow, case=_LEARNED),
    Key("beam_shape.covariance", "learned.covariance", (),
        "covariance of clamp_softness, clamp_shift, skew_rad, widths and bow",
        look_up=_shape_covariance, case=_LEARNED),

    Key("gravity.direction_deg", "gravity.direction", (-360, 360),
        "direction of gravity, from x towards y", _O, case=_GRAVITY),
    Key("gravity.direction_sigma_deg", "gravity.sigma", (0, 180),
        f"{_SIGMA} of this direction", case=_GRAVITY),
)  # fmt: skip
