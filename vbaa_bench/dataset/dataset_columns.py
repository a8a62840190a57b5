"""Columns and keys of the files of a dataset: truth.parquet, metadata.csv, manifest, rig.json."""

from typing import Final

from solver.instrument.rig_keys import KEYS
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

# Keys of rig.json; solver/README.md explains how to measure them.
RIG: Final = {
    key.name: Column(key.meaning, key.frame, key.absent or key.case.absent) for key in KEYS
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
