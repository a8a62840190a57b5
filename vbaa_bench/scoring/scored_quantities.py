"""The scored quantities: their columns in predictions and in the truth."""

from dataclasses import dataclass
from typing import Final

import polars as pl


@dataclass(frozen=True)
class ScoredQuantity:
    """Scored quantity: its columns in a predictions table, and its true value from `Truth.frames`.

    Names of its columns in the scores end with `unit`: `<name>_error_<unit>`.
    """

    name: str
    unit: str
    true: pl.Expr

    @property
    def column(self) -> str:
        """Column of the estimate."""
        return f"{self.name}_{self.unit}"

    @property
    def sigma(self) -> str:
        """Column of the estimate's stated standard deviation."""
        return f"{self.name}_sigma_{self.unit}"

    @property
    def truth(self) -> str:
        """Column of the true value."""
        return f"true_{self.column}"

    @property
    def error(self) -> str:
        """Column of the error, estimate minus truth."""
        return f"{self.name}_error_{self.unit}"

    @property
    def in_sigmas(self) -> str:
        """Column of the normalised error, error over stated standard deviation."""
        return f"{self.name}_error_in_sigmas"


# A rigid object has compliance 0; without contact the compliance is null.
_HAS_CONTACT = pl.col("x_c_mm").is_not_null()
_COMPLIANCE = pl.when(_HAS_CONTACT).then((1e3 / pl.col("k_s_n_m")).fill_null(0.0))
COMPLIANCE: Final = ScoredQuantity("compliance", "mm_per_n", _COMPLIANCE)

SCORED_QUANTITIES: Final = (
    ScoredQuantity("x_c", "mm", pl.col("x_c_mm")),
    ScoredQuantity("s_c", "mm", pl.col("s_c_mm")),
    ScoredQuantity("theta_c", "deg", pl.col("theta_c_deg")),
    ScoredQuantity("force", "n", pl.col("force_n")),
    ScoredQuantity("f", "n", pl.col("f_n")),
    ScoredQuantity("psi", "deg", pl.col("psi_deg")),
    COMPLIANCE,
    ScoredQuantity("motor_angle", "deg", pl.col("true_motor_angle_deg")),
)
# Vectors: (name, unit, the truth's column of three numbers).
VECTORS: Final = (
    ("contact_antenna", "mm", "contact_antenna_mm"),
    ("contact_world", "mm", "contact_world_mm"),
    ("force", "n", "force_antenna_n"),
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
    "image_ms",
)
