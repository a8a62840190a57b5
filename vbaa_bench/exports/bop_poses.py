"""Poses of the clamp and of the contact in the camera's frame, in BOP's notation."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final

import numpy as np

from solver.instrument.arrays import Floats
from solver.instrument.units import DEGREE, MILLIMETRE
from vbaa_bench.exports.rig import Rig
from vbaa_bench.scoring.camera_frame import camera_frame_from_clamp

# Rounding of a pose: a chain of three products of matrices in double precision [mm].
_ROUNDING_MM: Final = 1e-6


def beam_id(rig_number: int) -> int:
    """Return the number of a rig's clamp as an object of BOP; that of its contact is one more."""
    return 2 * rig_number + 1


def poses(rig: Rig, row: Mapping[str, Any], rig_number: int) -> list[dict[str, Any]]:
    """Compute the poses of the clamp and, if something is touched, of the contact.

    The clamp's frame has its x axis along the clamped beam. The contact's origin is the contact
    point on the centreline; y is the direction of the force on the beam, x that of the part of the
    clamp's x axis that is perpendicular to y. BOP maps model to camera: `cam_R_m2c` by rows,
    `cam_t_m2c` in mm.
    """
    fixed_from_clamp = camera_frame_from_clamp(rig.truth, row["true_motor_angle_deg"] * DEGREE)
    camera_from_clamp = rig.camera.camera_from_antenna @ fixed_from_clamp
    entries = [_entry(beam_id(rig_number), camera_from_clamp)]
    if row["force_antenna_n"] is not None and np.any(row["force_antenna_n"]):
        clamp_from_contact = np.eye(4)
        clamp_from_contact[:3, :3] = _contact_axes(np.array(row["force_antenna_n"]))
        clamp_from_contact[:3, 3] = _contact_mm(rig, row) * MILLIMETRE
        entries.append(_entry(beam_id(rig_number) + 1, camera_from_clamp @ clamp_from_contact))
    return entries


def _contact_mm(rig: Rig, row: Mapping[str, Any]) -> Floats:
    """Return the contact point in the clamp's frame [mm]: both frames have the same axes."""
    base_mm = rig.truth.manifest["true_rig"]["base_position_mm"]
    return np.asarray(np.array(row["contact_antenna_mm"]) - base_mm)


def _contact_axes(force: Floats) -> Floats:
    """Make the axes (3, 3), as columns, of the contact's frame from the force on the beam."""
    y = force / np.linalg.norm(force)
    # A force along the clamp's axis leaves x open; the camera's side of the plane is as good.
    along = np.array([1.0, 0, 0]) if abs(y[0]) < 0.999 else np.array([0, 0, 1.0])
    x = along - (along @ y) * y
    x /= np.linalg.norm(x)
    return np.column_stack([x, y, np.cross(x, y)])


def _entry(number: int, pose: Floats) -> dict[str, Any]:
    return {
        "cam_R_m2c": pose[:3, :3].ravel().tolist(),
        "cam_t_m2c": (pose[:3, 3] / MILLIMETRE).tolist(),
        "obj_id": number,
    }


def pose_errors(
    rig: Rig,
    row: Mapping[str, Any],
    camera: Mapping[str, Any],
    entries: Sequence[Mapping[str, Any]],
) -> Iterator[str]:
    """Check the poses of one image by the projection of its contact, from Sigma_o.

    The contact in the world, turned back by the motor angle unless the camera is fixed in the
    world, must be at the contact's pose. Rotations must be right-handed.
    """
    for entry in entries:
        rotation = np.array(entry["cam_R_m2c"]).reshape(3, 3)
        proper = np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-9)
        if not (proper and np.linalg.det(rotation) > 0):
            yield f"cam_R_m2c of object {entry['obj_id']} is no rotation"
    if not np.array_equal(np.reshape(camera["cam_K"], (3, 3)), rig.camera.matrix):
        yield "cam_K is not the matrix of the true camera"
    contact = row["contact_antenna_mm"]
    if (contact is not None) != (len(entries) == 2):
        yield f"it has {len(entries)} poses"
    if contact is not None and len(entries) == 2:
        mount = rig.stated("camera.mount")
        point = row["contact_world_mm"] if mount == "world" else contact
        camera_mm = rig.camera.camera_from_antenna.copy()
        camera_mm[:3, 3] /= MILLIMETRE
        expected = camera_mm[:3] @ [*point, 1.0]
        if np.abs(expected - entries[1]["cam_t_m2c"]).max() > _ROUNDING_MM:
            yield "cam_t_m2c of the contact is not where its truth is"
