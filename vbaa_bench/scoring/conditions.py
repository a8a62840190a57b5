"""Names of the conditions in which the frames of a dataset differ.

The command line imports them for its help, without any table.
"""

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
# Columns of the scores, too, with their meanings: classes of conditions, which `strata` makes.
STRATA: Final = {
    "deflection_class": "class of deflection_pct",
    "contact_distance_class": "class of the true contact distance in % of L",
    "availability_class": "class of the availability ratio (eq. 32)",
    "psi_class": "class of the absolute true psi",
    "light": "kind of the first light",
    "noise_class": "class of a pixel's noise, in % of the beam's peak",
    "scene": "title of the scene",
}
# Prefix of the columns of factors in the scores of a collection.
FACTOR_PREFIX: Final = "factor."
