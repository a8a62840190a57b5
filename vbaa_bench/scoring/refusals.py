"""Right refusals: frames from which even a good method cannot estimate the contact.

For such a frame, values with consistent sigmas are also right. Allowed outcomes follow from the
truth:

- no contact: only "no contact";
- a bend below the noise: "no contact" below `min_snr`, "not identifiable" below `sure_snr`;
- a small visible part of the beam: "not identifiable";
- a camera that looks along the plane in which the beam bends, eqs. (7), (8): "edge-on" or
  "not identifiable";
- a camera that was knocked after the images at rest: "camera moved";
- a second contact, so that no single point contact explains the shape: "invalid" or
  "not identifiable".

A refusal may name the assumption that the image contradicts, see `Assumption`. It is right if the
truth violates this assumption by more than the rig states, see `violations`; "invalid" with another
name is wrong, also where there is a second contact.
"""

from typing import Final, NamedTuple

import numpy as np
import polars as pl

from solver.instrument.arrays import Floats
from solver.instrument.estimate import Outcome
from solver.instrument.units import DEGREE, MILLIMETRE
from vbaa_bench.dataset.readers import Truth
from vbaa_bench.scoring.camera_frame import camera_frames_from_clamp
from vbaa_bench.scoring.violations import violations

# Noise of a column [px], as the paper's area-weighted average has it.
COLUMN_SIGMA_PX: Final = 0.05


class Thresholds(NamedTuple):
    """Where a frame is so hard that a refusal is right.

    `min_snr` and `sure_snr` are signal-to-noise ratios: the tip's shift over the standard error of
    the mean of all columns. Below 5 a bend cannot be detected; from 60 on the information limit of
    x_c is below a seventh of the beam (measured). `min_visible` is a visible fraction of the beam,
    and `edge_on_deg` the angle between line of sight and plane of bending: there eqs. (7), (8)
    multiply the error of a point by 1 / sin(15 deg), about 4. Both are chosen, for methods like
    those of the paper; the information limit allows much more: 0.05 % of L at 15 degrees, and
    0.2 % at 5, where at 90 it is 0.02 (`limits`, knife edge, deflections of 2 to 10 %).
    `python -m results.random` measures what the share of consistent frames owes to each of them.
    """

    min_snr: float = 5.0
    sure_snr: float = 60.0
    min_visible: float = 0.25
    edge_on_deg: float = 15.0


THRESHOLDS: Final = Thresholds()


def right_refusals(truth: Truth, thresholds: Thresholds = THRESHOLDS) -> pl.DataFrame:
    """Compute for each frame_id which refusals are right.

    Columns: the `snr` of the bend; `true_state`, the first reason for a refusal in the order of
    `_STATES`, or "contact"; `acceptable_outcomes`, the right refusals; and `violated`, the
    assumptions that do not hold.
    """
    frames = truth.frames
    visible = _visible_fractions(frames)
    snr = _snr(truth, visible)
    touched = frames["x_c_mm"].is_not_null().to_numpy()
    # Older manifests do not have the key.
    knocked = any(truth.manifest["scene"].get("camera", {}).get("knock_px", ()))
    holds = {
        "no contact": ~touched,
        "two contacts": touched & frames["second_s_c_mm"].is_not_null().to_numpy(),
        "camera moved": touched & knocked,
        "edge-on": touched & (_sights_against_plane_deg(truth) < thresholds.edge_on_deg),
        "hardly visible": touched & (visible < thresholds.min_visible),
        "bend below the noise": touched & (snr < thresholds.min_snr),
        "weak bend": touched & (snr < thresholds.sure_snr),
    }
    table = pl.DataFrame({"frame_id": frames["frame_id"], "snr": snr, **holds})
    allowed = pl.concat_list(
        pl.when(pl.any_horizontal(state for state, right in _STATES.items() if outcome in right))
        .then(pl.lit(str(outcome)))
        .otherwise(None)
        for outcome in sorted({outcome for right in _STATES.values() for outcome in right})
    )
    states = pl.coalesce(pl.when(state).then(pl.lit(state)) for state in _STATES)
    return table.select(
        "frame_id",
        "snr",
        true_state=states.fill_null("contact"),
        acceptable_outcomes=allowed.list.drop_nulls(),
    ).join(violations(truth), on="frame_id", maintain_order="left")


def rightly_refused() -> pl.Expr:
    """Return the condition of a right refusal, from the columns of `right_refusals`."""
    named = pl.col("assumption").is_not_null()
    by_outcome = pl.col("acceptable_outcomes").list.contains(pl.col("outcome"))
    by_name = pl.col("violated").list.contains(pl.col("assumption")).fill_null(value=False)
    invalid = pl.col("outcome") == str(Outcome.INVALID)
    return by_name | (by_outcome & ~(named & invalid))


# States of a frame in which a refusal is right, and the right outcomes.
_STATES: Final = {
    "no contact": (Outcome.NO_CONTACT,),
    "two contacts": (Outcome.INVALID, Outcome.NOT_IDENTIFIABLE),
    "camera moved": (Outcome.CAMERA_MOVED,),
    "edge-on": (Outcome.EDGE_ON, Outcome.NOT_IDENTIFIABLE),
    "hardly visible": (Outcome.NOT_IDENTIFIABLE,),
    "bend below the noise": (Outcome.NO_CONTACT, Outcome.NOT_IDENTIFIABLE),
    "weak bend": (Outcome.NOT_IDENTIFIABLE,),
}


def _visible_fractions(frames: pl.DataFrame) -> Floats:
    """Return the visible fractions (n,) of the beam; 1 where it was not recorded."""
    if "visible_share" not in frames.columns:
        return np.ones(frames.height)
    return frames["visible_share"].cast(pl.Float64).fill_null(1.0).to_numpy()


def _snr(truth: Truth, visible: Floats) -> Floats:
    """Compute the tip's shift in the image over the standard error of all visible columns, (n,)."""
    frames = truth.frames
    length = truth.manifest["true_rig"]["beam_length_mm"] * MILLIMETRE
    psi = frames["psi_deg"].cast(pl.Float64).fill_null(0.0).to_numpy() * DEGREE
    shift = frames["deflection_pct"].to_numpy() / 100 * length
    straight = np.tile([length, 0.0, 0.0], (frames.height, 1))
    bent = np.column_stack([straight[:, 0], shift * np.cos(psi), shift * np.sin(psi)])
    transforms = camera_frames_from_clamp(truth, _motor_angles(truth))
    clamp, tip, deflected_tip = (
        truth.camera.project(
            np.einsum("nij,nj->ni", transforms[:, :3, :3], points) + transforms[:, :3, 3]
        )
        for points in (np.zeros_like(straight), straight, bent)
    )
    columns = np.linalg.norm(tip - clamp, axis=1) * visible
    snr = np.linalg.norm(deflected_tip - tip, axis=1) * np.sqrt(columns) / COLUMN_SIGMA_PX
    return np.asarray(snr)


def _sights_against_plane_deg(truth: Truth) -> Floats:
    """Compute the angles (n,) [deg] of the rays to the contacts with plane D; NaN without one."""
    frames = truth.frames
    transforms = camera_frames_from_clamp(truth, _motor_angles(truth))
    viewpoint = truth.camera.viewpoint
    from_clamp = viewpoint[:3] - viewpoint[3] * transforms[:, :3, 3]
    in_clamp = np.einsum("nji,nj->ni", transforms[:, :3, :3], from_clamp)
    psi = frames["psi_deg"].cast(pl.Float64).to_numpy() * DEGREE
    base = np.array(truth.manifest["true_rig"]["base_position_mm"])
    points = frames["contact_antenna_mm"].cast(pl.List(pl.Float64))
    contacts = np.column_stack([points.list.get(i).to_numpy() for i in range(3)])
    sight = in_clamp - viewpoint[3] * (contacts - base) * MILLIMETRE
    across = -np.sin(psi) * sight[:, 1] + np.cos(psi) * sight[:, 2]
    return np.asarray(np.arcsin(np.abs(across) / np.linalg.norm(sight, axis=1)) / DEGREE)


def _motor_angles(truth: Truth) -> Floats:
    return np.asarray(truth.frames["true_motor_angle_deg"].to_numpy() * DEGREE)
