"""Names of the conditions in which the frames of a dataset differ."""

from typing import Final

# Columns of the scores.
CONDITIONS: Final = (
    "push",
    "push_id",
    "step",
    "contact_distance_at_rest_mm",
    "deflection_pct",
    "pushing_angle_deg",
    "normal_deg",
    "k_s_n_m",
    "k_s_over_k_beam",
    "hidden_by",
    "hidden_place",
    "availability_asked",
)
# Columns of the scores, too: classes of conditions, which `strata` makes.
STRATA: Final = (
    "deflection_class",
    "contact_distance_class",
    "availability_class",
    "psi_class",
    "light",
    "noise_class",
    "scene",
)
