"""The nominal rig: what a laboratory knows of its antenna, and how well.

Every quantity carries a one-sigma tolerance; methods use them as priors. On disk it is
`rig.json`, with units in the keys; inside everything is SI.
"""

import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from solver.instrument.arrays import Floats, frozen_floats
from solver.instrument.beam import Beam
from solver.instrument.errors import InputError
from solver.instrument.transforms import rigid, rotation_vector
from solver.instrument.units import DEGREE, MILLIMETRE, NEWTON_SQUARE_MILLIMETRE

PROJECTIONS = ("perspective", "telecentric")
MOUNTS = ("antenna", "world")


@dataclass(frozen=True)
class Chessboard:
    """A chessboard of `columns` x `rows` inner corners, `square` [m] apart."""

    columns: int
    rows: int
    square: float

    def corners(self) -> Floats:
        """Inner corners (rows * columns, 3) [m] in the board's frame, row by row.

        The origin is the middle of the pattern, x runs along the rows, z towards the viewer.
        """
        y, x = np.mgrid[0 : self.rows, 0 : self.columns].astype(float)
        x -= (self.columns - 1) / 2
        y = (self.rows - 1) / 2 - y
        return np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)]) * self.square


@dataclass(frozen=True)
class Tolerances:
    """One-sigma tolerances: lengths [m], angles [rad], flexural rigidity [N m^2]."""

    beam_length: float
    flexural_rigidity: float
    base_position: float
    board_translation: float
    board_rotation: float
    encoder: float


@dataclass(frozen=True)
class Sensors:
    """One-sigma noise of the sensors at the clamp, None where there is none.

    `moment_y` [N m] of the moment about Sigma_a's y axis (section V-C); `base_force` [N] and
    `base_moment` [N m] of every component of what the clamp exerts on the beam.
    """

    moment_y: float | None = None
    base_force: float | None = None
    base_moment: float | None = None


@dataclass(frozen=True)
class Rig:
    """Nominal beam, clamp position (3,) [m] in Sigma_a, board of view 0, its pose, tolerances.

    `deflects_towards` is +1 or -1: the side of Sigma_a's y axis to which contact bends the beam.
    `telecentric` says which kind of camera looks on, `camera_mount` whether it rides on the
    "antenna" or stands in the "world", where Sigma_a is that at first contact. `known_psi` [rad] is
    the inclination of the only plane in which a flat strip bends; None for a round beam.
    """

    beam: Beam
    base_position: Floats
    board: Chessboard
    antenna_from_board: Floats
    deflects_towards: int
    tolerances: Tolerances
    telecentric: bool = False
    camera_mount: str = "antenna"
    known_psi: float | None = None
    sensors: Sensors = Sensors()

    def __post_init__(self) -> None:
        base = frozen_floats("base_position", self.base_position, (3,))
        pose = frozen_floats("antenna_from_board", self.antenna_from_board, (4, 4))
        object.__setattr__(self, "base_position", base)
        object.__setattr__(self, "antenna_from_board", pose)


def rig_to_json(rig: Rig) -> str:
    """The text of rig.json; the same rig gives the same bytes."""
    mm, tol = MILLIMETRE, rig.tolerances
    document: dict[str, dict[str, Any]] = {
        "beam": {
            "length_mm": rig.beam.length / mm,
            "length_sigma_mm": tol.beam_length / mm,
            "diameter_mm": rig.beam.diameter / mm,
            "flexural_rigidity_n_mm2": rig.beam.flexural_rigidity / NEWTON_SQUARE_MILLIMETRE,
            "flexural_rigidity_sigma_n_mm2": tol.flexural_rigidity / NEWTON_SQUARE_MILLIMETRE,
            "deflects_towards": rig.deflects_towards,
        },
        "base": {
            "position_mm": [v / mm for v in rig.base_position],
            "position_sigma_mm": tol.base_position / mm,
        },
        "board": {
            "columns": rig.board.columns,
            "rows": rig.board.rows,
            "square_mm": rig.board.square / mm,
            "antenna_from_board_translation_mm": [v / mm for v in rig.antenna_from_board[:3, 3]],
            "antenna_from_board_rotation_vector_deg": [
                float(v) / DEGREE for v in rotation_vector(rig.antenna_from_board)
            ],
            "translation_sigma_mm": tol.board_translation / mm,
            "rotation_sigma_deg": tol.board_rotation / DEGREE,
        },
        "encoder": {"sigma_deg": tol.encoder / DEGREE},
        "camera": {
            "projection": "telecentric" if rig.telecentric else "perspective",
            "mount": rig.camera_mount,
        },
    }
    if rig.known_psi is not None:
        document["beam"]["known_psi_deg"] = rig.known_psi / DEGREE
    if rig.sensors.moment_y is not None:
        document["moment_sensor"] = {"sigma_n_mm": rig.sensors.moment_y / mm}
    if rig.sensors.base_force is not None and rig.sensors.base_moment is not None:
        document["force_sensor"] = {
            "force_sigma_n": rig.sensors.base_force,
            "moment_sigma_n_mm": rig.sensors.base_moment / mm,
        }
    # Twelve digits: a nanometre on a kilometre, without the noise of unit conversion.
    return json.dumps(_rounded(document), indent=2) + "\n"


def _rounded(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _rounded(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_rounded(item) for item in value]
    return float(f"{value:.12g}") + 0.0 if isinstance(value, float) else value


def read_rig(path: Path) -> Rig:
    """The rig of a `rig.json`. Raises InputError naming file, key, value and what is allowed."""
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from error
    except ValueError as error:
        raise InputError(f"{path}: is not JSON ({error})") from error
    key = _Keys(path, document)
    mm = MILLIMETRE
    side = key.number("beam.deflects_towards", low=-1)
    if side not in (-1, 1):
        raise InputError(f"{path}: beam.deflects_towards is {side:g}, allowed is 1 or -1")
    return Rig(
        beam=Beam(
            length=key.positive("beam.length_mm") * mm,
            diameter=key.positive("beam.diameter_mm") * mm,
            flexural_rigidity=key.positive("beam.flexural_rigidity_n_mm2")
            * NEWTON_SQUARE_MILLIMETRE,
        ),
        base_position=key.triple("base.position_mm") * mm,
        board=Chessboard(
            columns=key.count("board.columns", low=3),
            rows=key.count("board.rows", low=3),
            square=key.positive("board.square_mm") * mm,
        ),
        antenna_from_board=rigid(
            key.triple("board.antenna_from_board_rotation_vector_deg") * DEGREE,
            key.triple("board.antenna_from_board_translation_mm") * mm,
        ),
        deflects_towards=int(side),
        tolerances=Tolerances(
            beam_length=key.number("beam.length_sigma_mm", low=0) * mm,
            flexural_rigidity=key.number("beam.flexural_rigidity_sigma_n_mm2", low=0)
            * NEWTON_SQUARE_MILLIMETRE,
            base_position=key.number("base.position_sigma_mm", low=0) * mm,
            board_translation=key.number("board.translation_sigma_mm", low=0) * mm,
            board_rotation=key.number("board.rotation_sigma_deg", low=0) * DEGREE,
            encoder=key.number("encoder.sigma_deg", low=0) * DEGREE,
        ),
        # A rig.json that says nothing of its camera has a pinhole.
        telecentric=key.has("camera.projection")
        and key.one_of("camera.projection", PROJECTIONS) == "telecentric",
        camera_mount=key.one_of("camera.mount", MOUNTS) if key.has("camera.mount") else "antenna",
        known_psi=key.number("beam.known_psi_deg", low=-90, high=90) * DEGREE
        if key.has("beam.known_psi_deg")
        else None,
        sensors=_sensors(key),
    )


def _sensors(key: "_Keys") -> Sensors:
    if key.has("force_sensor"):
        force = key.positive("force_sensor.force_sigma_n")
        moment = key.positive("force_sensor.moment_sigma_n_mm") * MILLIMETRE
    moment_y = key.positive("moment_sensor.sigma_n_mm") if key.has("moment_sensor") else None
    return Sensors(
        moment_y=None if moment_y is None else moment_y * MILLIMETRE,
        base_force=force if key.has("force_sensor") else None,
        base_moment=moment if key.has("force_sensor") else None,
    )


@dataclass(frozen=True)
class _Keys:
    """Looks dotted keys up in a JSON document and says clearly what is wrong with one."""

    path: Path
    document: Any

    def _value(self, key: str) -> Any:
        value = self.document
        for part in key.split("."):
            if not isinstance(value, dict) or part not in value:
                raise InputError(f"{self.path}: the key {key} is missing")
            value = value[part]
        return value

    def has(self, key: str) -> bool:
        value = self.document
        for part in key.split("."):
            if not isinstance(value, dict) or part not in value:
                return False
            value = value[part]
        return True

    def number(self, key: str, low: float, high: float = math.inf) -> float:
        value = self._value(key)
        if not _is_finite_number(value) or not low <= value <= high:
            bounds = f">= {low:g}" + ("" if high == math.inf else f" and <= {high:g}")
            raise InputError(f"{self.path}: {key} is {value!r}, allowed is a number {bounds}")
        return float(value)

    def count(self, key: str, low: int) -> int:
        value = self._value(key)
        if not isinstance(value, int) or isinstance(value, bool) or value < low:
            raise InputError(f"{self.path}: {key} is {value!r}, allowed is a whole number >= {low}")
        return value

    def positive(self, key: str) -> float:
        value = self._value(key)
        if not _is_finite_number(value) or value <= 0:
            raise InputError(f"{self.path}: {key} is {value!r}, allowed is a number > 0")
        return float(value)

    def one_of(self, key: str, allowed: tuple[str, ...]) -> str:
        value = self._value(key)
        if value not in allowed:
            raise InputError(
                f"{self.path}: {key} is {value!r}, allowed is one of {', '.join(allowed)}"
            )
        return str(value)

    def triple(self, key: str) -> Floats:
        value = self._value(key)
        if not (isinstance(value, list) and len(value) == 3 and all(map(_is_finite_number, value))):
            raise InputError(f"{self.path}: {key} is {value!r}, allowed is a list of three numbers")
        return np.array(value, dtype=np.float64)


def _is_finite_number(value: Any) -> bool:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return abs(value) < 1e300 and math.isfinite(value)  # a whole number may exceed every float
