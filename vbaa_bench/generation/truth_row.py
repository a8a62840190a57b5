"""The truth of a frame: lengths in mm, angles in degrees."""

import math
from typing import Any

import numpy as np

from solver.instrument.arrays import Floats
from solver.instrument.transforms import invert, turn_about_z
from solver.instrument.units import DEGREE, MILLIMETRE, PERCENT
from vbaa_bench.assembly.experiment import Experiment
from vbaa_bench.generation.readings import carriage_pose
from vbaa_bench.mechanics.state import Contact, State
from vbaa_bench.render.visibility import Visibility
from vbaa_bench.scene.frames import FrameSpec
from vbaa_bench.scene.rigs import nominal_rig


def truth_row(
    experiment: Experiment,
    spec: FrameSpec,
    state: State,
    hidden: tuple[float, float] | None,
    visible: Visibility | None = None,
) -> dict[str, Any]:
    """Collect the truth of one frame, as a row of `truth.parquet`.

    `hidden` [m] is the stretch of Sigma_a's x axis that is covered or removed, if any; bars and
    leaves cover only parts of it. `visible` is what the image shows of the beam, None if there is
    no image. Quantities that a frame without contact does not have are null.
    Centreline and tip are in the clamp's frame. `contact_antenna_mm` is relative to the nominal
    position of the clamp. `contact_world_mm` is in Sigma_o, which equals Sigma_a at motor angle
    zero.
    """
    scene, mm = experiment.scene, MILLIMETRE
    phi = spec.motor_angle(state.pushing_angle)
    stress = state.largest_strain * experiment.youngs_modulus / 1e6
    sag = _norm((state.tip - experiment.rest.tip)[1:])
    cover, push = spec.cover, spec.push
    rigid = push.compliance == 0
    return {
        "model": experiment.model,
        "trial": spec.index,
        "push_id": spec.push_id,
        "step": spec.step,
        "repeat": spec.repeat,
        "push": str(spec.target),
        "contact_distance_at_rest_mm": _scaled(push.contact_distance, 1 / mm),
        "normal_deg": push.normal / DEGREE,
        "k_s_n_m": None if rigid else 1 / push.compliance,
        "k_s_over_k_beam": _stiffness_ratio(experiment, state),
        "deflection_pct": sag / experiment.rig.beam.length / PERCENT,
        "pushing_angle_deg": state.pushing_angle / DEGREE,
        "true_motor_angle_deg": phi / DEGREE,
        **_contact(experiment, state, phi),
        **_second_contact(experiment, state),
        **_on_table(experiment, spec, state),
        "tip_mm": (state.tip / mm).tolist(),
        "base_force_n": state.base_force.tolist(),
        "base_moment_n_mm": (state.base_moment / mm).tolist(),
        "largest_stress_mpa": stress,
        "above_yield": stress > scene.beam.yield_stress_mpa,
        "hidden_by": None if cover is None else cover.kind,
        "hidden_place": None if cover is None else cover.place,
        "availability_asked": None if cover is None else cover.availability,
        "hidden_from_mm": None if hidden is None else hidden[0] / mm,
        "hidden_to_mm": None if hidden is None else hidden[1] / mm,
        **_visibility(visible, scene.beam.length_mm),
        "residual": state.residual,
        "centreline_s_mm": (state.centreline[:, 0] / mm).tolist(),
        "centreline_x_mm": (state.centreline[:, 1] / mm).tolist(),
        "centreline_y_mm": (state.centreline[:, 2] / mm).tolist(),
        "centreline_z_mm": (state.centreline[:, 3] / mm).tolist(),
    }


def _visibility(visible: Visibility | None, length_mm: float) -> dict[str, Any]:
    """Collect the columns of the beam's visible part; all are null without an image."""
    if visible is None:
        empty: dict[str, Any] = dict.fromkeys(
            ("visible_share", "availability_seen", "hidden_stretches_mm")
        )
        return empty
    return {
        "visible_share": visible.visible_share,
        "availability_seen": visible.availability,
        "hidden_stretches_mm": (length_mm * visible.hidden_stretches).ravel().tolist(),
    }


def _contact(experiment: Experiment, state: State, phi: float) -> dict[str, Any]:
    """Collect the columns of the first contact; all are null if nothing is touched."""
    mm = MILLIMETRE
    scalars = ("x_c_mm", "y_c_mm", "s_c_mm", "theta_c_deg", "psi_deg", "force_psi_deg", "force_n")
    vectors = ("force_antenna_n", "contact_deformation_mm", "contact_antenna_mm")
    if not state.contacts:
        empty: dict[str, Any] = dict.fromkeys(
            (*scalars, "f_n", "w_s_mm", *vectors, "contact_world_mm", "contact_row")
        )
        return empty
    contact: Contact = state.contact
    base = experiment.rig.base_position
    side = nominal_rig(experiment.scene).deflects_towards
    psi = _psi(experiment, contact, side)
    in_plane = np.array([0.0, side * np.cos(psi), np.sin(psi)])
    across = np.array([0.0, -side * np.sin(psi), np.cos(psi)])
    # Eq. (1). The motor turns the clamp about the true position of its axis.
    axis = np.array(experiment.motor.point)
    turn = turn_about_z(phi)[:3, :3]
    world = [_dot(row, contact.point - axis) for row in turn] + axis + base
    return {
        "x_c_mm": float(contact.point[0]) / mm,
        "y_c_mm": _dot(contact.point, in_plane) / mm,
        "s_c_mm": contact.s / mm,
        "theta_c_deg": contact.theta / DEGREE,
        "psi_deg": psi / DEGREE,
        "force_psi_deg": math.atan2(contact.force[2], side * contact.force[1]) / DEGREE,
        "force_n": _norm(contact.force),
        "f_n": _dot(contact.force, in_plane),
        "w_s_mm": _norm(contact.object_shift) / mm,
        "force_antenna_n": contact.force.tolist(),
        "contact_deformation_mm": [
            float(contact.point[0]) / mm,
            _dot(contact.point, in_plane) / mm,
            _dot(contact.point, across) / mm,
        ],
        "contact_antenna_mm": ((contact.point + base) / mm).tolist(),
        "contact_world_mm": (world / mm).tolist(),
        "contact_row": contact.row,
    }


def _dot(a: Floats, b: Floats) -> float:
    """Compute a dot product with one rounding: that of BLAS depends on the processor."""
    return math.fsum(a * b)


def _norm(a: Floats) -> float:
    return math.sqrt(_dot(a, a))


def _psi(experiment: Experiment, contact: Contact, side: int) -> float:
    """Compute the inclination [rad] of plane D, in which the contact has moved from its rest.

    It is against the `side` of y, 1 or -1, to which contact bends the beam.
    """
    line = experiment.rest.centreline
    rest = np.array([np.interp(contact.s, line[:, 0], line[:, i]) for i in (2, 3)])
    y, z = contact.point[1:] - rest
    return float(np.arctan2(z, side * y))


def _second_contact(experiment: Experiment, state: State) -> dict[str, Any]:
    """Collect the columns of a second contact; all are null if there is none."""
    second = next((contact for contact in state.contacts if contact.obstacle == 1), None)
    if second is None:
        names = ("second_s_c_mm", "second_force_antenna_n", "second_contact_antenna_mm")
        empty: dict[str, Any] = dict.fromkeys(names)
        return empty
    base = experiment.rig.base_position
    return {
        "second_s_c_mm": second.s / MILLIMETRE,
        "second_force_antenna_n": second.force.tolist(),
        "second_contact_antenna_mm": ((second.point + base) / MILLIMETRE).tolist(),
    }


def _on_table(experiment: Experiment, spec: FrameSpec, state: State) -> dict[str, Any]:
    """Collect the true pose of a carriage, and the touched point on its table."""
    if experiment.scene.carriage is None:
        return {}
    table_from_antenna = experiment.table_from_antenna(spec.onset)
    pose = {f"true_carriage_{k}": v for k, v in carriage_pose(table_from_antenna).items()}
    if not state.contacts:
        return {**pose, "touched_table_mm": None}
    object_from_clamp = invert(experiment.clamp_from_object(state, spec.step))
    touched = object_from_clamp @ np.append(state.contact.point + state.contact.lever, 1.0)
    object_from_table = experiment.scene.object.object_from_table(experiment.object_setting)
    on_table = invert(object_from_table) @ touched
    return {**pose, "touched_table_mm": (on_table[:3] / MILLIMETRE).tolist()}


def _stiffness_ratio(experiment: Experiment, state: State) -> float | None:
    """Divide the object's stiffness by the beam's, 3 EI / x_c^3; None if rigid or no contact."""
    if experiment.push.compliance == 0 or not state.contacts:
        return None
    rigidity = experiment.rig.beam.flexural_rigidity
    k_beam = 3 * rigidity / float(state.contact.point[0]) ** 3
    return 1 / experiment.push.compliance / k_beam


def _scaled(value: float | None, factor: float) -> float | None:
    return None if value is None else value * factor
