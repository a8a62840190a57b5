"""Quantities that an estimate may contain: SI names, table columns and units."""

import itertools
from typing import Final, NamedTuple

from solver.instrument.units import unit_of


class Column(NamedTuple):
    """Table column of a quantity, whose name states its unit."""

    name: str

    @property
    def unit(self) -> float:
        """Unit of the column, expressed in SI."""
        return unit_of(self.name).factor

    @property
    def sigma_name(self) -> str:
        """Name of the standard deviation's column, such as x_c_sigma_mm."""
        suffix = unit_of(self.name).suffix
        return f"{self.name.removesuffix(suffix)}_sigma{suffix}"


_POINTS: Final = tuple(itertools.product(("antenna", "world"), "xyz"))
# In Sigma_d: contact distance, deflection at the contact, contact arc length, |force|, the force's
# component across the undeformed beam (eq. 11), the tangent angle at the contact; psi is the
# inclination of D against C.
# In Sigma_a and Sigma_o, as `antenna` and `world`: the contact point, eqs. (1)-(5). In Sigma_a: the
# force on the beam; the displacement of the beam at the contact, eqs. (28), (29).
# Of a second contact, farther from the clamp: arc length, |force|, and in Sigma_a contact point and
# force on the beam.
# For a push: the object's compliance 1/k_s; k_s itself if the compliance is significantly above 0;
# Coulomb's friction coefficient; the radius of the object, 0 for an edge; and the motor angle at
# first contact.
QUANTITIES: Final[dict[str, Column]] = {
    "x_c_m": Column("x_c_mm"),
    "y_c_m": Column("y_c_mm"),
    "s_c_m": Column("s_c_mm"),
    "force_n": Column("force_n"),
    "f_n": Column("f_n"),
    "theta_c_rad": Column("theta_c_deg"),
    "psi_rad": Column("psi_deg"),
    **{f"contact_{f}_{a}_m": Column(f"contact_{f}_{a}_mm") for f, a in _POINTS},
    **{f"force_{a}_n": Column(f"force_{a}_n") for a in "xyz"},
    **{f"displacement_{a}_m": Column(f"displacement_{a}_mm") for a in "yz"},
    "second_s_c_m": Column("second_s_c_mm"),
    "second_force_n": Column("second_force_n"),
    **{f"second_contact_antenna_{a}_m": Column(f"second_contact_antenna_{a}_mm") for a in "xyz"},
    **{f"second_force_{a}_n": Column(f"second_force_{a}_n") for a in "xyz"},
    "compliance_m_per_n": Column("compliance_mm_per_n"),
    "stiffness_n_per_m": Column("stiffness_n_per_m"),
    "friction": Column("friction"),
    "object_radius_m": Column("object_radius_mm"),
    "onset_angle_rad": Column("onset_angle_deg"),
    "motor_angle_rad": Column("motor_angle_deg"),
}
# Inverse mapping: column name to SI name.
QUANTITY_OF: Final = {column.name: name for name, column in QUANTITIES.items()}
