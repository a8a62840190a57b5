"""Scores that are computed from others: what each is, and how it is made.

They are errors in per cent, of the beam's length or of the true value, and errors of vectors.

A column that is added here is computed, checked, described in the data dictionary and exported. If
it is an error and has a heading, its RMSE is also in the summary, in the tables of `vbaa-bench
table` and in the report.
"""

from collections.abc import Callable
from typing import Final, NamedTuple

import polars as pl

from vbaa_bench.dataset.column import SIGMA_D, Column, Presence
from vbaa_bench.dataset.dataset_columns import TRUTH
from vbaa_bench.dataset.document import LARGEST
from vbaa_bench.scoring.scored_quantities import VECTORS, components

FAILED: Final = "the frame has failed, or the method does not estimate it"


class ComputedScore(NamedTuple):
    """A column of the scores, and its expression, given the beam's length [mm].

    `heading` is that of its RMSE in tables; empty: no table shows it because of this declaration.
    """

    column: Column
    value: Callable[[float], pl.Expr]
    heading: str = ""


def _of_length(
    name: str, meaning: str, frame: str = "along the beam", null: str = FAILED, heading: str = ""
) -> ComputedScore:
    column = Column(meaning, frame, null, presence=Presence.PRESENT)
    return ComputedScore(column, lambda length_mm: 100 * pl.col(name) / length_mm, heading)


def _of_truth(
    error: str, true: str, meaning: str, frame: str = "", null: str = FAILED, heading: str = ""
) -> ComputedScore:
    """An error relative to its true value; null if this is zero."""
    ratio = (100 * pl.col(error) / pl.col(true)).clip(-LARGEST, LARGEST)
    value = pl.when(pl.col(true) != 0).then(ratio)
    column = Column(
        f"{meaning}, relative to its true value", frame, null, presence=Presence.PRESENT
    )
    return ComputedScore(column, lambda _length_mm: value, heading)


def _of_springs(one: ComputedScore) -> ComputedScore:
    """The same, null for a rigid object."""
    return one._replace(
        value=lambda length_mm: pl.when(pl.col("k_s_n_m").is_not_null()).then(one.value(length_mm))
    )


def _of_vector(name: str, unit: str, true: str) -> ComputedScore:
    """The norm of a vector's error; null unless all components are estimated."""
    squares = [pl.col(component.error) ** 2 for component in components(name, unit, true)]
    norm = pl.sum_horizontal(squares, ignore_nulls=False).sqrt()
    column = Column(f"norm of the error of {true}", TRUTH[true].frame, FAILED)
    return ComputedScore(column, lambda _length_mm: norm)


VECTOR_ERRORS: Final = {
    f"{name}_vector_error_{unit}": _of_vector(name, unit, true) for name, unit, true in VECTORS
}
COMPUTED: Final = {
    "x_c_error_pct_L": _of_length("x_c_error_mm", "error of x_c", SIGMA_D),
    "x_c_limit_pct_L": _of_length(
        "x_c_limit_mm", "information limit of x_c", SIGMA_D, "there is no limit"
    ),
    "s_c_error_pct_L": _of_length("s_c_error_mm", "error of s_c"),
    "force_error_pct": _of_truth("force_error_n", "true_force_n", "error of force_n"),
    "f_error_pct": _of_truth("f_error_n", "true_f_n", "error of f_n", SIGMA_D),
    "second_s_c_error_pct_L": _of_length("second_s_c_error_mm", "error of second_s_c"),
    "second_force_error_pct": _of_truth(
        "second_force_error_n", "true_second_force_n", "error of second_force_n"
    ),
    "compliance_error_pct": _of_springs(
        _of_truth(
            "compliance_error_mm_per_n",
            "true_compliance_mm_per_n",
            "error of the compliance",
            null=f"the object is rigid, or {FAILED}",
        )
    ),
    **VECTOR_ERRORS,
}
