"""Right refusals: frames from which even a good method cannot estimate the contact.

For such a frame, values with consistent sigmas are also right. Allowed outcomes follow from the
truth:

- no contact: only "no contact";
- a bend below the noise: "no contact" below `MIN_SNR`, "not identifiable" below `SURE_SNR`;
- a small visible part of the beam: "not identifiable";
- a camera that looks along the plane in which the beam bends, eqs. (7), (8): "edge-on" or
  "not identifiable";
- a camera that was knocked after the images at rest: "camera moved";
- a second contact, so that no single point contact explains the shape: "invalid" or
  "not identifiable".
"""

from typing import Any, Final

import numpy as np
import polars as pl

from solver.instrument.estimate import Outcome
from solver.instrument.transforms import apply, invert
from solver.instrument.units import DEGREE, MILLIMETRE
from vbaa_bench.dataset.readers import Truth
from vbaa_bench.scoring.camera_frame import camera_frame_from_clamp

# Signal-to-noise ratio: the tip's shift over the standard error of the mean of all columns, if one
# column has a sigma of COLUMN_SIGMA_PX, as the paper's area-weighted average has. Below 5 a bend
# cannot be detected; from 60 on the information limit of x_c is below a seventh of the beam.
MIN_SNR: Final = 5.0
SURE_SNR: Final = 60.0
COLUMN_SIGMA_PX: Final = 0.05
# With a visible fraction below this, the position of the hidden part is undetermined.
MIN_VISIBLE: Final = 0.25
# A line of sight this close to the deformation plane [deg] is edge-on.
EDGE_ON_DEG: Final = 15.0


def right_refusals(truth: Truth) -> pl.DataFrame:
    """Compute for each frame_id the `snr` of its bend and `may_say`, the right refusals."""
    rows = [
        {"frame_id": row["frame_id"], "snr": snr, "may_say": _allowed_outcomes(truth, row, snr)}
        for row in truth.frames.iter_rows(named=True)
        for snr in [_snr(truth, row)]
    ]
    schema = pl.Schema(
        {"frame_id": pl.String(), "snr": pl.Float64(), "may_say": pl.List(pl.String())}
    )
    return pl.DataFrame(rows, schema=schema)


def _snr(truth: Truth, row: dict[str, Any]) -> float:
    """Compute the tip's shift in the image over the standard error of all visible columns."""
    length = truth.manifest["true_rig"]["beam_length_mm"] * MILLIMETRE
    psi = (row["psi_deg"] or 0.0) * DEGREE
    shift = row["deflection_pct"] / 100 * length * np.array([np.cos(psi), np.sin(psi)])
    points = np.array([[0.0, 0.0, 0.0], [length, 0.0, 0.0], [length, *shift]])
    frame_from_clamp = camera_frame_from_clamp(truth, row["true_motor_angle_deg"] * DEGREE)
    clamp, tip, deflected_tip = truth.camera.project(apply(frame_from_clamp, points))
    visible_columns = np.linalg.norm(tip - clamp) * _visible_fraction(row)
    return float(np.linalg.norm(deflected_tip - tip) * np.sqrt(visible_columns) / COLUMN_SIGMA_PX)


def _allowed_outcomes(truth: Truth, row: dict[str, Any], snr: float) -> list[str]:
    if row["x_c_mm"] is None:
        return [str(Outcome.NO_CONTACT)]
    allowed = set[Outcome]()
    if snr < MIN_SNR:
        allowed |= {Outcome.NO_CONTACT}
    if snr < SURE_SNR or _visible_fraction(row) < MIN_VISIBLE:
        allowed |= {Outcome.NOT_IDENTIFIABLE}
    if _sight_against_plane_deg(truth, row) < EDGE_ON_DEG:
        allowed |= {Outcome.EDGE_ON, Outcome.NOT_IDENTIFIABLE}
    # Older manifests do not have the key.
    if any(truth.manifest["scene"].get("camera", {}).get("knock_px", ())):
        allowed |= {Outcome.CAMERA_MOVED}
    if row["second_s_c_mm"] is not None:
        allowed |= {Outcome.INVALID, Outcome.NOT_IDENTIFIABLE}
    return sorted(map(str, allowed))


def _visible_fraction(row: dict[str, Any]) -> float:
    """Return the visible fraction of the beam; 1 if it was not recorded."""
    fraction = row.get("visible_share")
    return 1.0 if fraction is None else float(fraction)


def _sight_against_plane_deg(truth: Truth, row: dict[str, Any]) -> float:
    """Compute the angle [deg] between the ray to the contact and the deformation plane."""
    frame_from_clamp = camera_frame_from_clamp(truth, row["true_motor_angle_deg"] * DEGREE)
    viewpoint = invert(frame_from_clamp) @ truth.camera.viewpoint
    psi = row["psi_deg"] * DEGREE
    across = np.array([-np.sin(psi), np.cos(psi)])
    base = np.array(truth.manifest["true_rig"]["base_position_mm"])
    contact = (np.array(row["contact_antenna_mm"]) - base) * MILLIMETRE
    sight = viewpoint[:3] - viewpoint[3] * contact
    return float(np.arcsin(abs(sight[1:] @ across) / np.linalg.norm(sight)) / DEGREE)
