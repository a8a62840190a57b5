"""Types of the columns of scores.parquet; `columns.py` describes their meaning."""

from typing import Final

from vbaa_bench.dataset.table_schema import FLAG, INTEGER, NUMBER, TEXT, Schema
from vbaa_bench.scoring.conditions import STRATA
from vbaa_bench.scoring.scored_quantities import COMPONENTS, LIMITED, NUMBERS, SCORED_QUANTITIES

_QUANTITIES: Final = (*SCORED_QUANTITIES, *COMPONENTS)
_NAMES: Final = ("frame_id", "method", "outcome", "push_id", "push", "information")
_TEXTS: Final = (
    *_NAMES,
    *STRATA,
    "true_state",
    "message",
    "assumption",
    "hidden_by",
    "hidden_place",
)
_FLAGS: Final = (
    *("last_step", "free", "failed", "crashed", "refused", "rightly_refused", "consistent"),
)
_CONDITIONS: Final = (
    *("contact_distance_at_rest_mm", "deflection_pct", "pushing_angle_deg", "normal_deg"),
    *("k_s_n_m", "k_s_over_k_beam", "availability_asked", "snr", "x_c_limit_pct_L"),
    *("x_c_error_pct_L", "s_c_error_pct_L", "force_error_pct", "f_error_pct"),
    *("second_s_c_error_pct_L", "second_force_error_pct", "compliance_error_pct"),
)
_OF_QUANTITIES: Final = (
    name
    for quantity in _QUANTITIES
    for name in (quantity.truth, quantity.error, quantity.in_sigmas)
)
_NUMBERS: Final = (
    *(*_CONDITIONS, *NUMBERS, *_OF_QUANTITIES, *(quantity.limit for quantity in LIMITED)),
)

SCORES: Final = Schema(
    types={
        **dict.fromkeys(_NUMBERS, NUMBER),
        **dict.fromkeys(_TEXTS, TEXT),
        **dict.fromkeys(_FLAGS, FLAG),
        "step": INTEGER,
        "rig": INTEGER,
    },
    required=(*_NAMES, *_FLAGS, *STRATA, "step", "true_state"),
    # Runs of older versions have no reference time: their times are not compared.
    present=(
        *(name for name in _NUMBERS if name != "reference_ms"),
        *("message", "hidden_by", "hidden_place"),
    ),
    positive=tuple(quantity.limit for quantity in LIMITED),
)
