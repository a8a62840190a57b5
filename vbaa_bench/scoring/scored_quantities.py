"""The scored quantities: their columns in predictions and in the truth."""

from dataclasses import dataclass
from typing import Final

import polars as pl

from solver.lab.table import CORRELATIONS
from vbaa_bench.dataset.labels import HAS_CONTACT, TRUE_COMPLIANCE


@dataclass(frozen=True, eq=False)
class ScoredQuantity:
    """Scored quantity: its columns in a predictions table, and its true value.

    `true` is an expression of the columns of `Truth.frames`, of the friction coefficient and
    of the object's radius.

    Names of its columns in the scores end with `unit`, if it has one: `<name>_error_<unit>`.
    `words` name it in sentences.
    """

    name: str
    unit: str
    true: pl.Expr
    words: str = ""

    @property
    def column(self) -> str:
        """Column of the estimate."""
        return self._with_unit(self.name)

    @property
    def sigma(self) -> str:
        """Column of the estimate's stated standard deviation."""
        return self._with_unit(f"{self.name}_sigma")

    @property
    def truth(self) -> str:
        """Column of the true value."""
        return f"true_{self.column}"

    @property
    def error(self) -> str:
        """Column of the error, estimate minus truth."""
        return self._with_unit(f"{self.name}_error")

    @property
    def limit(self) -> str:
        """Column of the information limit, the least standard deviation without bias."""
        return self._with_unit(f"{self.name}_limit")

    def _with_unit(self, name: str) -> str:
        return f"{name}_{self.unit}" if self.unit else name

    @property
    def in_sigmas(self) -> str:
        """Column of the normalised error, error over stated standard deviation."""
        return f"{self.name}_error_in_sigmas"


# Half the widths of the stated intervals whose coverage is reported, in stated standard deviations.
COVERAGE: Final = {"coverage_68": 1.0, "coverage_95": 1.96}
# Largest error, in stated standard deviations, that is consistent with them. Chosen: it is exceeded
# by one Gaussian error in 370.
CONSISTENT_SIGMAS: Final = 3.0

COMPLIANCE: Final = ScoredQuantity("compliance", "mm_per_n", TRUE_COMPLIANCE, "the compliance")
SECOND_S_C: Final = ScoredQuantity(
    "second_s_c", "mm", pl.col("second_s_c_mm"), "the second contact's arc length"
)
PSI: Final = ScoredQuantity("psi", "deg", pl.col("psi_deg"), "the inclination psi")
X_C: Final = ScoredQuantity("x_c", "mm", pl.col("x_c_mm"), "the contact distance")
# The motor turns by minus the pushing angle from first contact on.
_ONSET = pl.when(HAS_CONTACT).then(pl.col("true_motor_angle_deg") + pl.col("pushing_angle_deg"))
# A column without any contact has no type.
_Y_C, _PSI = pl.col("y_c_mm").cast(pl.Float64), pl.col("psi_deg").cast(pl.Float64).radians()
# psi is against the side to which contact bends the beam: -y for a weight that hangs there.
_FORCE = pl.col("force_antenna_n").cast(pl.List(pl.Float64))
_TO_MINUS_Y = (_FORCE.list.get(1) < -_FORCE.list.get(2).abs()) & (_PSI.cos() > 0)
_SIDE = pl.when(_TO_MINUS_Y).then(-1.0).otherwise(1.0)
# A column without a second contact has no type.
_SECOND_FORCE = pl.col("second_force_antenna_n").cast(pl.List(pl.Float64))
_SECOND_SQUARES = [_SECOND_FORCE.list.get(i) ** 2 for i in range(3)]
_SECOND_SIZE = pl.sum_horizontal(_SECOND_SQUARES, ignore_nulls=False).sqrt()

# Quantities that may have an information limit.
LIMITED: Final = (
    X_C,
    ScoredQuantity("s_c", "mm", pl.col("s_c_mm"), "the contact arc length"),
    ScoredQuantity("force", "n", pl.col("force_n"), "the force"),
    PSI,
    SECOND_S_C,
    ScoredQuantity("second_force", "n", _SECOND_SIZE, "the second force"),
    COMPLIANCE,
)
SCORED_QUANTITIES: Final = (
    *LIMITED,
    ScoredQuantity("y_c", "mm", pl.col("y_c_mm")),
    ScoredQuantity("theta_c", "deg", pl.col("theta_c_deg")),
    ScoredQuantity("f", "n", pl.col("f_n")),
    # Eqs. (28), (29): the deflection at the contact, turned by psi.
    ScoredQuantity("displacement_y", "mm", _SIDE * _Y_C * _PSI.cos()),
    ScoredQuantity("displacement_z", "mm", _Y_C * _PSI.sin()),
    ScoredQuantity("stiffness", "n_per_m", pl.col("k_s_n_m")),
    ScoredQuantity("friction", "", pl.when(HAS_CONTACT).then(pl.col("friction"))),
    ScoredQuantity("object_radius", "mm", pl.when(HAS_CONTACT).then(pl.col("object_radius_mm"))),
    ScoredQuantity("onset_angle", "deg", _ONSET),
    ScoredQuantity("motor_angle", "deg", pl.col("true_motor_angle_deg")),
)
# Vectors: (name, unit, the truth's column of three numbers).
VECTORS: Final = (
    ("contact_antenna", "mm", "contact_antenna_mm"),
    ("contact_world", "mm", "contact_world_mm"),
    ("force", "n", "force_antenna_n"),
    ("second_contact_antenna", "mm", "second_contact_antenna_mm"),
    ("second_force", "n", "second_force_antenna_n"),
)


def components(name: str, unit: str, true: str) -> tuple[ScoredQuantity, ...]:
    """Make the three components of one of VECTORS, each a scored quantity."""
    vector = pl.col(true).cast(pl.List(pl.Float64))  # the column has no type without any contact
    return tuple(
        ScoredQuantity(f"{name}_{axis}", unit, vector.list.get(i)) for i, axis in enumerate("xyz")
    )


COMPONENTS: Final = tuple(quantity for vector in VECTORS for quantity in components(*vector))
NUMBERS: Final = (
    *(
        name
        for quantity in (*SCORED_QUANTITIES, *COMPONENTS)
        for name in (quantity.column, quantity.sigma)
    ),
    *CORRELATIONS,
    "image_ms",
    "processor_ms",
    "reference_ms",
)
