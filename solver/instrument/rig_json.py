"""The file rig.json: the nominal rig with its tolerances, units in the keys."""

import json
from pathlib import Path
from typing import Any

import numpy as np

from solver.instrument.beam import Beam
from solver.instrument.beam_shape_json import beam_shape_keys, read_beam_shape
from solver.instrument.board import DICTIONARIES, Board, Charuco, Chessboard, LineNetwork
from solver.instrument.clamp_offset import clamp_offset_keys, read_clamp_offset
from solver.instrument.distortion import COUNTS
from solver.instrument.errors import InputError
from solver.instrument.gravity import gravity_keys, read_gravity
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
    Rig,
    Sensors,
    Tolerances,
)
from solver.instrument.transforms import rigid, rotation_vector
from solver.instrument.units import DEGREE, MILLIMETRE, NEWTON_SQUARE_MILLIMETRE

BOARDS = ("chessboard", "charuco", "lines")
PROJECTIONS = ("perspective", "telecentric")
MOUNTS = ("antenna", "world")
SENSOR_NOISE = (1e-15, 1e6)  # noise of a sensor [N] or [N mm]
BOARD_POINTS = (3, 200)  # per row and column of a board; OpenCV's detectors take minutes for more
BITS = (8, 16)
# Sigma of the apparent end of a bent beam where rig.json states none, in radii. Chosen: a sixth of
# a pixel on the paper's rig, where psi has three times the sigma that it has with a sharp end.
TIP_SIGMA_RADII = 0.2
# Sigma of the motor angle where rig.json states none. Chosen: an angle that is set on a hobby servo
# or read from a protractor. It does not matter where no angle is read.
ENCODER_SIGMA_DEG = 1.0


def rig_to_json(rig: Rig) -> str:
    """Format a rig as the text of rig.json; the same rig gives the same bytes."""
    mm, tol = MILLIMETRE, rig.tolerances
    document: dict[str, dict[str, Any]] = {
        "beam": {
            "length_mm": rig.beam.length / mm,
            "length_sigma_mm": tol.beam_length / mm,
            "tip_sigma_mm": tol.tip / mm,
            "diameter_mm": rig.beam.diameter / mm,
            "flexural_rigidity_n_mm2": rig.beam.flexural_rigidity / NEWTON_SQUARE_MILLIMETRE,
            "flexural_rigidity_sigma_n_mm2": tol.flexural_rigidity / NEWTON_SQUARE_MILLIMETRE,
            "deflects_towards": rig.deflects_towards,
        },
        "base": {
            "position_mm": [v / mm for v in rig.base_position],
            "position_sigma_mm": tol.base_position / mm,
            **clamp_offset_keys(rig.clamp_offset),
        },
        "board": {
            **_board_keys(rig.board),
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
            "distortion_coefficients": rig.distortion_coefficients,
        },
    }
    if tol.camera_shift_px:
        document["camera"]["camera_shift_sigma_px"] = tol.camera_shift_px
    if rig.bits is not None:
        document["camera"]["bits"] = rig.bits
    if rig.channel != "gray":
        document["camera"]["channel"] = rig.channel
    if (rig.light_slope, rig.light_slope_sigma) != (0.0, ANY_LIGHT):
        document["light"] = {"slope": rig.light_slope, "slope_sigma": rig.light_slope_sigma}
    if rig.light_distance is not None:
        document.setdefault("light", {})["distance_mm"] = rig.light_distance / mm
    if rig.light_across != ANY_LIGHT:
        document.setdefault("light", {})["across"] = rig.light_across
    if rig.sag:
        document["beam"]["sag_mm"] = rig.sag / mm
    if rig.sag_in_plane.any():
        document["beam"]["sag_in_plane_mm"] = [v / mm for v in rig.sag_in_plane]
    if rig.known_psi is not None:
        document["beam"]["known_psi_deg"] = rig.known_psi / DEGREE
    if rig.sensors.moment_y is not None:
        document["moment_sensor"] = {"sigma_n_mm": rig.sensors.moment_y / mm}
    if rig.sensors.base_force is not None and rig.sensors.base_moment is not None:
        document["force_sensor"] = {
            "force_sigma_n": rig.sensors.base_force,
            "moment_sigma_n_mm": rig.sensors.base_moment / mm,
        }
    document["beam_shape"] = beam_shape_keys(rig.shape, rig.beam.length)
    if rig.gravity is not None:
        document["gravity"] = gravity_keys(rig.gravity)
    # Twelve digits: a nanometre on a kilometre, without the rounding errors of unit conversion.
    return json.dumps(_rounded(document), indent=2) + "\n"


def _board_keys(board: Board) -> dict[str, Any]:
    keys: dict[str, Any] = {"kind": "chessboard"}
    if isinstance(board, Charuco):
        keys = {"kind": "charuco", "dictionary": board.dictionary}
    elif isinstance(board, LineNetwork):
        keys = {"kind": "lines", "line_width_mm": board.line_width / MILLIMETRE}
    square_mm = board.square / MILLIMETRE
    return keys | {"columns": board.columns, "rows": board.rows, "square_mm": square_mm}


def _rounded(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _rounded(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_rounded(item) for item in value]
    return float(f"{value:.12g}") + 0.0 if isinstance(value, float) else value


def read_rig(path: Path) -> Rig:
    """Read a `rig.json`. Raises InputError with file, key, value and the allowed values.

    An unknown key is an error too: a misspelt one would silently be a tolerance left out.
    """
    key = Keys.read(path)
    mm = MILLIMETRE
    # Default for a rig.json without a camera: a pinhole without distortion.
    telecentric = (
        key.has("camera.projection")
        and key.one_of("camera.projection", PROJECTIONS) == "telecentric"
    )
    length_mm = key.number("beam.length_mm", *SIZES_MM)
    # A beam must be longer than it is thick.
    diameter_mm = key.number("beam.diameter_mm", SIZES_MM[0], length_mm)
    rig = Rig(
        beam=Beam(
            length=length_mm * mm,
            diameter=diameter_mm * mm,
            flexural_rigidity=key.number("beam.flexural_rigidity_n_mm2", *RIGIDITIES_N_MM2)
            * NEWTON_SQUARE_MILLIMETRE,
        ),
        base_position=key.triple("base.position_mm", -MAX_POSITION_MM, MAX_POSITION_MM) * mm,
        board=_board(key),
        antenna_from_board=rigid(
            key.triple("board.antenna_from_board_rotation_vector_deg", -360, 360) * DEGREE,
            key.triple("board.antenna_from_board_translation_mm", -MAX_POSITION_MM, MAX_POSITION_MM)
            * mm,
        ),
        deflects_towards=int(key.one_of("beam.deflects_towards", (1, -1))),
        tolerances=Tolerances(
            beam_length=key.number("beam.length_sigma_mm", 0, length_mm) * mm,
            flexural_rigidity=key.number(
                "beam.flexural_rigidity_sigma_n_mm2", 0, RIGIDITIES_N_MM2[1]
            )
            * NEWTON_SQUARE_MILLIMETRE,
            base_position=key.number("base.position_sigma_mm", 0, MAX_POSITION_MM) * mm,
            board_translation=key.number("board.translation_sigma_mm", 0, MAX_POSITION_MM) * mm,
            board_rotation=key.number("board.rotation_sigma_deg", 0, 180) * DEGREE,
            encoder=(
                key.number("encoder.sigma_deg", 0, 180)
                if key.has("encoder.sigma_deg")
                else ENCODER_SIGMA_DEG
            )
            * DEGREE,
            camera_shift_px=key.number("camera.camera_shift_sigma_px", 0, MAX_SHIFT_PX)
            if key.has("camera.camera_shift_sigma_px")
            else 0.0,
            tip=(
                key.number("beam.tip_sigma_mm", 0, length_mm)
                if key.has("beam.tip_sigma_mm")
                else TIP_SIGMA_RADII * diameter_mm / 2
            )
            * mm,
        ),
        telecentric=telecentric,
        camera_mount=key.one_of("camera.mount", MOUNTS) if key.has("camera.mount") else "antenna",
        known_psi=key.number("beam.known_psi_deg", -90, 90) * DEGREE
        if key.has("beam.known_psi_deg")
        else None,
        sag=key.number("beam.sag_mm", -length_mm, length_mm) * mm
        if key.has("beam.sag_mm")
        else 0.0,
        sag_in_plane=key.pair("beam.sag_in_plane_mm", -length_mm, length_mm) * mm
        if key.has("beam.sag_in_plane_mm")
        else np.zeros(2),
        light_slope=key.number("light.slope", -MAX_LIGHT_SLOPE, MAX_LIGHT_SLOPE)
        if key.has("light.slope")
        else 0.0,
        light_slope_sigma=key.number("light.slope_sigma", 0, MAX_LIGHT_SLOPE)
        if key.has("light.slope_sigma")
        else ANY_LIGHT,
        light_distance=key.number("light.distance_mm", *LIGHT_DISTANCES_MM) * mm
        if key.has("light.distance_mm")
        else None,
        light_across=key.number("light.across", 0, MAX_LIGHT_SLOPE)
        if key.has("light.across")
        else ANY_LIGHT,
        sensors=_sensors(key),
        distortion_coefficients=_distortion_coefficients(key, telecentric),
        bits=key.count("camera.bits", *BITS) if key.has("camera.bits") else None,
        channel=key.one_of("camera.channel", CHANNELS) if key.has("camera.channel") else "gray",
        shape=read_beam_shape(key, length_mm * mm),
        gravity=read_gravity(key),
        clamp_offset=read_clamp_offset(key),
    )
    key.refuse_others()
    return rig


def _board(key: Keys) -> Board:
    columns, rows = (
        key.count("board.columns", *BOARD_POINTS),
        key.count("board.rows", *BOARD_POINTS),
    )
    square = key.number("board.square_mm", *SIZES_MM) * MILLIMETRE
    # Default for a rig.json without the kind of its board: a chessboard.
    kind = key.one_of("board.kind", BOARDS) if key.has("board.kind") else "chessboard"
    try:
        if kind == "charuco":
            return Charuco(columns, rows, square, key.one_of("board.dictionary", DICTIONARIES))
        if kind == "lines":
            width = key.number("board.line_width_mm", *SIZES_MM) * MILLIMETRE
            return LineNetwork(columns, rows, square, width)
    except ValueError as error:
        raise InputError(f"{key.path}: board: {error}") from error
    return Chessboard(columns, rows, square)


def _distortion_coefficients(key: Keys, telecentric: bool) -> int:
    name = "camera.distortion_coefficients"
    count = key.one_of(name, COUNTS) if key.has(name) else 0
    if count and telecentric:
        raise InputError(f"{key.path}: {name} is {count}, a telecentric camera has none")
    return int(count)


def _sensors(key: Keys) -> Sensors:
    if key.has("force_sensor"):
        force = key.number("force_sensor.force_sigma_n", *SENSOR_NOISE)
        moment = key.number("force_sensor.moment_sigma_n_mm", *SENSOR_NOISE) * MILLIMETRE
    moment_y = (
        key.number("moment_sensor.sigma_n_mm", *SENSOR_NOISE) if key.has("moment_sensor") else None
    )
    return Sensors(
        moment_y=None if moment_y is None else moment_y * MILLIMETRE,
        base_force=force if key.has("force_sensor") else None,
        base_moment=moment if key.has("force_sensor") else None,
    )
