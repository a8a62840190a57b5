"""Types of the columns of truth.parquet; `generation/columns.py` describes their meaning."""

from typing import Final

from vbaa_bench.dataset.table_schema import FLAG, INTEGER, NUMBER, NUMBERS, TEXT, Schema

_TEXTS: Final = (
    *("frame_id", "push_id", "push", "model", "hidden_by", "hidden_place", "split", "processor"),
)
_INTEGERS: Final = ("step", "trial", "repeat", "contact_row")
_VECTORS: Final = (
    *("force_antenna_n", "contact_deformation_mm", "contact_antenna_mm", "contact_world_mm"),
    *("second_force_antenna_n", "second_contact_antenna_mm"),
    *("tip_mm", "base_force_n", "base_moment_n_mm", "touched_table_mm"),
)
CENTRELINE: Final = tuple(f"centreline_{axis}_mm" for axis in "sxyz")
_LISTS: Final = ("hidden_stretches_mm", *CENTRELINE)
_NUMBERS: Final = (
    *("contact_distance_at_rest_mm", "normal_deg", "k_s_n_m", "k_s_over_k_beam", "deflection_pct"),
    *("pushing_angle_deg", "true_motor_angle_deg", "x_c_mm", "y_c_mm", "s_c_mm", "theta_c_deg"),
    *("psi_deg", "force_psi_deg", "force_n", "f_n", "w_s_mm", "second_s_c_mm", "residual"),
    *("largest_stress_mpa", "availability_asked", "hidden_from_mm", "hidden_to_mm"),
    *("visible_share", "availability_seen"),
    *("true_carriage_x_mm", "true_carriage_y_mm", "true_carriage_turn_deg"),
)
# Columns that the scores need, in all frames; others may be absent from older datasets.
_REQUIRED: Final = ("frame_id", "push_id", "step", "push", "trial", "true_motor_angle_deg")
_MEASURED: Final = ("deflection_pct", "pushing_angle_deg", "normal_deg")

# Columns that the scores need, and that are null in some frames.
_PRESENT: Final = (
    *("contact_distance_at_rest_mm", "k_s_n_m", "k_s_over_k_beam", "x_c_mm", "y_c_mm", "s_c_mm"),
    *("theta_c_deg", "psi_deg", "force_n", "f_n", "hidden_by", "hidden_place"),
    *("availability_asked", "force_antenna_n", "contact_antenna_mm", "contact_world_mm"),
    *("second_s_c_mm",),
)

TRUTH: Final = Schema(
    types={
        **dict.fromkeys(_TEXTS, TEXT),
        **dict.fromkeys(_INTEGERS, INTEGER),
        **dict.fromkeys((*_VECTORS, *_LISTS), NUMBERS),
        **dict.fromkeys(_NUMBERS, NUMBER),
        "above_yield": FLAG,
    },
    required=(*_REQUIRED, *_MEASURED),
    present=_PRESENT,
    vectors=_VECTORS,
    finite=_NUMBERS,
    together=("x_c_mm", "y_c_mm", "s_c_mm", "theta_c_deg", "psi_deg", "force_n", "f_n"),
)
