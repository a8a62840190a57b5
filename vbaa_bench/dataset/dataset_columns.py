"""Columns and keys of the files of a dataset: truth.parquet, metadata.csv, manifest, rig.json."""

from typing import Final

from vbaa_bench.dataset.column import (
    ALONG_X,
    CLAMP,
    FREE,
    SIGMA_A,
    SIGMA_D,
    SIGMA_O,
    TABLE,
    Column,
    Kind,
    Presence,
)
from vbaa_bench.dataset.tables import schema_of

# Columns that join the truth to the readings; both files have them.
JOINED: Final = {
    "frame_id": Column("opaque name of the frame", kind=Kind.TEXT, presence=Presence.COMPLETE),
    "push_id": Column(
        "opaque name of the push, common to its frames", kind=Kind.TEXT, presence=Presence.COMPLETE
    ),
    "step": Column(
        "number of the frame within its push, from 0", kind=Kind.INTEGER, presence=Presence.COMPLETE
    ),
}
_HIDING: Final = "the scene has no occlusion"
_NO_IMAGE: Final = "nothing was rendered"
_ONE_CONTACT: Final = "no second object is touched"

# Made by `truth_row`.
TRUTH: Final = {
    **JOINED,
    "model": Column("mechanical model that was solved", kind=Kind.TEXT),
    "processor": Column(
        "kind of processor; another one may give other last digits", kind=Kind.TEXT
    ),
    "trial": Column(
        "number of the frame in the scene's list of pushes",
        kind=Kind.INTEGER,
        presence=Presence.COMPLETE,
    ),
    "repeat": Column("repetition of the push, from 0", kind=Kind.INTEGER),
    "push": Column(
        "target of the step: deflection or pushing angle, as text",
        kind=Kind.TEXT,
        presence=Presence.COMPLETE,
    ),
    "contact_distance_at_rest_mm": Column(
        "distance at which the undeformed beam first touches",
        SIGMA_A,
        "the object is a wall",
        presence=Presence.PRESENT,
    ),
    "normal_deg": Column(
        "requested inclination of the object's normal against plane C",
        SIGMA_A,
        presence=Presence.COMPLETE,
    ),
    "k_s_n_m": Column(
        "stiffness of the object", "", "the object is rigid", presence=Presence.PRESENT
    ),
    "k_s_over_k_beam": Column(
        "stiffness of the object over 3 EI / x_c^3",
        "",
        f"the object is rigid, or {FREE}",
        presence=Presence.PRESENT,
    ),
    "deflection_pct": Column(
        "displacement of the tip across the beam, in % of L", CLAMP, presence=Presence.COMPLETE
    ),
    "pushing_angle_deg": Column(
        "rotation of the motor since first contact", presence=Presence.COMPLETE
    ),
    "true_motor_angle_deg": Column(
        "motor angle, without the encoder's error", SIGMA_O, presence=Presence.COMPLETE
    ),
    "x_c_mm": Column(
        "contact distance, of the centreline", SIGMA_D, FREE, presence=Presence.PRESENT
    ),
    "y_c_mm": Column(
        "displacement of the contact point across the beam, in plane D",
        SIGMA_D,
        FREE,
        presence=Presence.PRESENT,
    ),
    "s_c_mm": Column(
        "contact arc length from the clamp", "along the beam", FREE, presence=Presence.PRESENT
    ),
    "theta_c_deg": Column(
        "angle between the tangents at contact and clamp", CLAMP, FREE, presence=Presence.PRESENT
    ),
    "psi_deg": Column(
        "inclination of plane D, in which the contact has moved",
        SIGMA_A,
        FREE,
        presence=Presence.PRESENT,
    ),
    "force_psi_deg": Column(
        "inclination of the force component across the clamp's tangent", SIGMA_A, FREE
    ),
    "force_n": Column(
        "magnitude of the object's force on the beam", "", FREE, presence=Presence.PRESENT
    ),
    "f_n": Column(
        "component of the force in plane D across the beam at rest",
        SIGMA_D,
        FREE,
        presence=Presence.PRESENT,
    ),
    "w_s_mm": Column("displacement of the object by its compliance", "", FREE),
    "force_antenna_n": Column(
        "force of the object on the beam (x, y, z)",
        SIGMA_A,
        FREE,
        kind=Kind.VECTOR,
        presence=Presence.PRESENT,
    ),
    "contact_deformation_mm": Column("contact point (x, y, z)", SIGMA_D, FREE, kind=Kind.VECTOR),
    "contact_antenna_mm": Column(
        "contact point, from the nominal clamp (x, y, z)",
        SIGMA_A,
        FREE,
        kind=Kind.VECTOR,
        presence=Presence.PRESENT,
    ),
    "contact_world_mm": Column(
        "contact point (x, y, z)", SIGMA_O, FREE, kind=Kind.VECTOR, presence=Presence.PRESENT
    ),
    "contact_row": Column(
        "row of the contact in the centreline, from 0", "", FREE, kind=Kind.INTEGER
    ),
    "second_s_c_mm": Column(
        "arc length of the second contact",
        "along the beam",
        _ONE_CONTACT,
        presence=Presence.PRESENT,
    ),
    "second_force_antenna_n": Column(
        "force of the second object (x, y, z)", SIGMA_A, _ONE_CONTACT, kind=Kind.VECTOR
    ),
    "second_contact_antenna_mm": Column(
        "second contact point (x, y, z)", SIGMA_A, _ONE_CONTACT, kind=Kind.VECTOR
    ),
    "true_carriage_x_mm": Column("x of the origin of Sigma_o; absent without a carriage", TABLE),
    "true_carriage_y_mm": Column("y of the origin of Sigma_o; absent without a carriage", TABLE),
    "true_carriage_turn_deg": Column("rotation of Sigma_o; absent without a carriage", TABLE),
    "touched_table_mm": Column(
        "touched point of the object (x, y, z); absent without a carriage",
        TABLE,
        FREE,
        kind=Kind.VECTOR,
    ),
    "tip_mm": Column("tip of the beam (x, y, z)", CLAMP, kind=Kind.VECTOR),
    "base_force_n": Column("force of the clamp on the beam (x, y, z)", SIGMA_A, kind=Kind.VECTOR),
    "base_moment_n_mm": Column(
        "moment of the clamp on the beam (x, y, z)", SIGMA_A, kind=Kind.VECTOR
    ),
    "largest_stress_mpa": Column("largest bending stress"),
    "above_yield": Column("whether this stress exceeds the yield stress", kind=Kind.FLAG),
    "hidden_by": Column(
        "kind of the requested occlusion", "", _HIDING, kind=Kind.TEXT, presence=Presence.PRESENT
    ),
    "hidden_place": Column(
        "place of the requested occlusion: base, contact, middle or tip",
        "",
        _HIDING,
        kind=Kind.TEXT,
        presence=Presence.PRESENT,
    ),
    "availability_asked": Column(
        "requested availability ratio", "", _HIDING, presence=Presence.PRESENT
    ),
    "hidden_from_mm": Column("start of the interval to be hidden", ALONG_X, "nothing is hidden"),
    "hidden_to_mm": Column("end of the interval to be hidden", ALONG_X, "nothing is hidden"),
    "visible_share": Column("visible length over the length of the beam", "", _NO_IMAGE),
    "availability_seen": Column(
        "visible length over the length within the image (eq. 32)", "", _NO_IMAGE
    ),
    "hidden_stretches_mm": Column(
        "start and end of each hidden stretch, in turn",
        "along the beam",
        _NO_IMAGE,
        kind=Kind.NUMBERS,
    ),
    "residual": Column("worst relative error of the equations of equilibrium"),
    "centreline_s_mm": Column(
        "arc lengths of the centreline, from clamp to tip", "along the beam", kind=Kind.NUMBERS
    ),
    "centreline_x_mm": Column("x of the centreline", CLAMP, kind=Kind.NUMBERS),
    "centreline_y_mm": Column("y of the centreline", CLAMP, kind=Kind.NUMBERS),
    "centreline_z_mm": Column("z of the centreline", CLAMP, kind=Kind.NUMBERS),
    "drawn.*": Column("value that was drawn for this push or frame, by its key in the scene"),
}

_REMOVED: Final = "nothing is removed; absent if the scene removes nothing"
_CARRIAGE: Final = "never; absent without a carriage"
_FORCE_SENSOR: Final = "never; absent without a force sensor"

# Made by `readings`, after file_name and frame_id.
READINGS: Final = {
    "file_name": Column("image of the frame, beside metadata.csv", kind=Kind.TEXT),
    **JOINED,
    "motor_angle_deg": Column(
        "encoder reading of the motor angle", SIGMA_O, "the camera is fixed in the world"
    ),
    "split": Column(
        "part of the set for training or testing; absent without `splits`", kind=Kind.TEXT
    ),
    "removed_from_mm": Column("start of the interval to leave out", ALONG_X, _REMOVED),
    "removed_to_mm": Column("end of the interval to leave out", ALONG_X, _REMOVED),
    "moment_y_n_mm": Column(
        "moment sensor: moment about y", SIGMA_A, "never; absent without a moment sensor"
    ),
    **{
        f"base_force_{axis}_n": Column(
            f"force sensor: {axis} of the force of the clamp on the beam", SIGMA_A, _FORCE_SENSOR
        )
        for axis in "xyz"
    },
    **{
        f"base_moment_{axis}_n_mm": Column(
            f"force sensor: {axis} of the moment of the clamp on the beam", SIGMA_A, _FORCE_SENSOR
        )
        for axis in "xyz"
    },
    "carriage_x_mm": Column("x of the origin of Sigma_o", TABLE, _CARRIAGE),
    "carriage_y_mm": Column("y of the origin of Sigma_o", TABLE, _CARRIAGE),
    "carriage_turn_deg": Column("rotation of Sigma_o", TABLE, _CARRIAGE),
    "carriage_sigma_mm": Column("standard deviation of this x and of this y", TABLE, _CARRIAGE),
    "carriage_turn_sigma_deg": Column("standard deviation of this rotation", TABLE, _CARRIAGE),
}

# Made by `dataset_facts`. Poses are 4 x 4 matrices with translations in metres.
TRUE_RIG: Final = {
    "beam_length_mm": Column("true length L of the beam"),
    "beam_diameter_mm": Column("true diameter; thickness in the plane of bending of a strip"),
    "flexural_rigidity_n_mm2": Column("true EI at the clamp"),
    "base_position_mm": Column("true position of the clamp (x, y, z)", SIGMA_A),
    "antenna_from_board": Column(
        "true pose of the board in view 0: 4 x 4, translation in m", SIGMA_A
    ),
    "camera.width_px": Column("width of the image"),
    "camera.height_px": Column("height of the image"),
    "camera.fx_px": Column("focal length along u; in px/m for a telecentric camera", "image"),
    "camera.fy_px": Column("focal length along v; in px/m for a telecentric camera", "image"),
    "camera.cx_px": Column("principal point, u, after a knock", "image"),
    "camera.cy_px": Column("principal point, v, after a knock", "image"),
    "camera.camera_from_antenna": Column("pose of the camera: 4 x 4, translation in m", SIGMA_A),
    "camera.telecentric": Column("whether the camera is telecentric"),
    "camera.distortion": Column("distortion coefficients, in OpenCV's order; empty without"),
}

_STRIP: Final = "the beam is no flat strip (absent)"
_WIRE: Final = "it is that of drawn wire in a chuck (absent)"
_NO_GRAVITY: Final = "no stated gravity (absent)"
_NOT_LEARNED: Final = "the beam was not learned (absent)"
_ON_AXIS: Final = "the clamp is on the axis (absent)"
_SIGMA: Final = "standard deviation"

# Keys of rig.json, written by `rig_to_json`; solver/README.md explains how to measure them.
RIG: Final = {
    "beam.length_mm": Column("nominal length, clamp to tip"),
    "beam.length_sigma_mm": Column(f"{_SIGMA} of the length"),
    "beam.tip_sigma_mm": Column(
        f"{_SIGMA} of the apparent end of the bent beam, less that at rest"
    ),
    "beam.diameter_mm": Column("nominal diameter"),
    "beam.flexural_rigidity_n_mm2": Column("nominal EI"),
    "beam.flexural_rigidity_sigma_n_mm2": Column(f"{_SIGMA} of EI"),
    "beam.deflects_towards": Column("side of y to which contact bends the beam: 1 or -1", SIGMA_A),
    "beam.sag_mm": Column("distance of the tip at rest below plane C", SIGMA_A, "it is 0 (absent)"),
    "beam.sag_in_plane_mm": Column(
        "the same within plane C, along the weight (x, y)", "Sigma_o", "it is 0 (absent)"
    ),
    "beam.known_psi_deg": Column("inclination of the only plane of bending", SIGMA_A, _STRIP),
    "base.position_mm": Column("nominal position of the clamp (x, y, z)", SIGMA_A),
    "base.position_sigma_mm": Column(f"{_SIGMA} of each coordinate", SIGMA_A),
    "base.clamp_offset_mm": Column(
        "position of the clamp relative to the motor's axis (x, y)", SIGMA_A, _ON_AXIS
    ),
    "base.clamp_offset_covariance_mm2": Column("covariance of this position", SIGMA_A, _ON_AXIS),
    "board.kind": Column("chessboard, charuco or lines"),
    "board.dictionary": Column(
        "dictionary of the markers", "", "the board is not charuco (absent)"
    ),
    "board.line_width_mm": Column("width of the thin lines", "", "the board is not lines (absent)"),
    "board.columns": Column("number of inner corners or crossings per row"),
    "board.rows": Column("number of inner corners or crossings per column"),
    "board.square_mm": Column("spacing of these points"),
    "board.antenna_from_board_translation_mm": Column(
        "nominal position of the pattern's middle in view 0", SIGMA_A
    ),
    "board.antenna_from_board_rotation_vector_deg": Column("nominal rotation in view 0", SIGMA_A),
    "board.translation_sigma_mm": Column(f"{_SIGMA} of each coordinate", SIGMA_A),
    "board.rotation_sigma_deg": Column(f"{_SIGMA} of the rotation about each axis", SIGMA_A),
    "encoder.sigma_deg": Column(f"{_SIGMA} of the motor angle"),
    "light.slope": Column(
        "tangent, along the beam, between the directions to the light and to the camera", SIGMA_A
    ),
    "light.slope_sigma": Column(f"{_SIGMA} of this tangent", SIGMA_A),
    "light.distance_mm": Column(
        "distance from plane C of a small lamp whose direction changes as much along the beam"
    ),
    "light.across": Column(
        "root mean square tangent, across the beam, between these two directions", SIGMA_A
    ),
    "camera.projection": Column("perspective or telecentric"),
    "camera.mount": Column("antenna: turns with the motor; world: fixed"),
    "camera.distortion_coefficients": Column("number of distortion coefficients: 0, 5 or 8"),
    "camera.camera_shift_sigma_px": Column(
        f"{_SIGMA} of undetected image shifts", "image", "it is 0 (absent)"
    ),
    "camera.bits": Column("bit depth of the gray values", "", "found from the images (absent)"),
    "camera.channel": Column("channel read from colour images", "", "it is gray (absent)"),
    "gravity.direction_deg": Column(
        "direction of gravity, from x towards y", "Sigma_o", _NO_GRAVITY
    ),
    "gravity.direction_sigma_deg": Column(f"{_SIGMA} of this direction", "", _NO_GRAVITY),
    "beam_shape.taper_sigma": Column(
        f"{_SIGMA} of the tip's width over that at the clamp, less one", "", _WIRE
    ),
    "beam_shape.section_sigma": Column(
        f"{_SIGMA} of the section's second axis over its first, less one", "", _WIRE
    ),
    "beam_shape.friction_sigma": Column(
        f"{_SIGMA} of the coefficient of friction of objects", "", _WIRE
    ),
    "beam_shape.bow_sigma_mm": Column(
        f"{_SIGMA} of the tip's distance from the clamp's tangent at rest",
        "",
        "only the rest images show it (absent)",
    ),
    "beam_shape.rigid_objects": Column(
        "whether objects do not yield, and the motor only pushes on", "", "they may (absent)"
    ),
    "beam_shape.friction_coefficient": Column(
        "coefficient of friction of rigid objects", "", "it is not known (absent)"
    ),
    "beam_shape.clamp_softness_sigma": Column(
        f"{_SIGMA} of the clamp's rotation over its moment, in units of L / EI", "", _WIRE
    ),
    "beam_shape.clamp_shift_sigma_mm": Column(
        f"{_SIGMA} of where the beam begins to bend, beyond the clamp's position",
        "",
        "it is 0 (absent)",
    ),
    "beam_shape.widths": Column(
        "coefficients of the width over that at the clamp", "", _NOT_LEARNED
    ),
    "beam_shape.clamp_softness": Column(
        "rotation of the clamp over its moment, in units of L / EI", "", _NOT_LEARNED
    ),
    "beam_shape.clamp_shift": Column(
        "place where the beam begins to bend, beyond the clamp's position, over the length",
        "",
        _NOT_LEARNED,
    ),
    "beam_shape.skew_rad": Column(
        "angle from the plane of the force to that of the deflection, as psi", "", _NOT_LEARNED
    ),
    "beam_shape.bow": Column(
        "coefficients of s^2, s^3, s^4 of the line at rest, over the length", "", _NOT_LEARNED
    ),
    "beam_shape.covariance": Column(
        "covariance of clamp_softness, clamp_shift, skew_rad, widths and bow", "", _NOT_LEARNED
    ),
    "beam_shape.rigidity_sigma": Column(
        f"relative {_SIGMA} of EI due to the section's direction",
        "",
        "it follows from section_sigma (absent)",
    ),
    "moment_sensor.sigma_n_mm": Column(f"{_SIGMA} of the moment", "", "no sensor (absent)"),
    "force_sensor.force_sigma_n": Column(
        f"{_SIGMA} of each force component", "", "no sensor (absent)"
    ),
    "force_sensor.moment_sigma_n_mm": Column(
        f"{_SIGMA} of each moment component", "", "no sensor (absent)"
    ),
}

# Columns of rigs.csv. Made by `rig_row`.
RIGS: Final = {
    "rig": Column("number of the rig, as in rig_00000"),
    "reason": Column("why the rig could not be generated", "", "it was generated"),
    "failed_frames": Column("number of frames that failed", "", "the rig was not generated"),
    "seed": Column("seed of the rig's scene", "", "no rig could be drawn"),
    "*.*": Column(
        "value that was drawn for the rig, by its key in the scene",
        "",
        "the rig has no such key, or could not be drawn",
    ),
}

CENTRELINE: Final = tuple(f"centreline_{axis}_mm" for axis in "sxyz")
_NUMBERS: Final = [name for name, column in TRUTH.items() if column.kind is Kind.NUMBER]
TRUTH_SCHEMA: Final = schema_of(TRUTH)._replace(
    finite=_NUMBERS,
    together=("x_c_mm", "y_c_mm", "s_c_mm", "theta_c_deg", "psi_deg", "force_n", "f_n"),
)
