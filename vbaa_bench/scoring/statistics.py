"""Statistics of the scores: each is declared once, with its meaning and how it is computed.

A statistic takes one number of every frame that has it, its term, and reduces these numbers to one.
Tables of errors, summaries, reports and comparisons follow from the declarations.
"""

import functools
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np
import polars as pl
from scipy.special import ndtr

from solver.instrument.arrays import Floats
from solver.instrument.estimate import Outcome
from vbaa_bench.scoring.computed_scores import COMPUTED
from vbaa_bench.scoring.refusals import THRESHOLDS
from vbaa_bench.scoring.scored_quantities import (
    COMPLIANCE,
    CONSISTENT_SIGMAS,
    COVERAGE,
    LIMITED,
    PSI,
    SECOND_S_C,
    X_C,
    ScoredQuantity,
)

# Outcomes that state values.
CONTACTS: Final = [str(outcome) for outcome in Outcome if outcome.has_values]
# Chosen: the largest error of guessing the middle of the beam, so that leaving a frame out is no
# advantage for a method that is better than this guess.
FAILURE_ERROR_PCT_L: Final = 50.0


class Reduction(NamedTuple):
    """A reduction of numbers to one: of an array (n,), n > 0, and of a column within a query.

    The two sum in different orders and may differ by rounding. `empty` is the value without any
    number.
    """

    of: Callable[[Floats], float]
    expression: Callable[[pl.Expr], pl.Expr]
    empty: float | None = None


def _percentile(probability: float) -> Reduction:
    return Reduction(
        lambda values: float(np.quantile(values, probability)),
        lambda column: column.quantile(probability, "linear"),
    )


COUNT: Final = Reduction(len, pl.Expr.count, empty=0)
MEAN: Final = Reduction(lambda values: float(np.mean(values)), pl.Expr.mean)
RMS: Final = Reduction(
    lambda values: float(np.sqrt(np.mean(values**2))), lambda column: (column**2).mean().sqrt()
)
MEDIAN: Final = Reduction(lambda values: float(np.quantile(values, 0.5)), pl.Expr.median)
P05: Final = _percentile(0.05)
P95: Final = _percentile(0.95)
LARGEST: Final = Reduction(lambda values: float(np.max(values)), pl.Expr.max)
# Of errors over information limits: the share of the information that is used.
INFORMATION_USED: Final = Reduction(
    lambda values: 1 / RMS.of(values) ** 2, lambda column: 1 / RMS.expression(column) ** 2
)


class Heading(NamedTuple):
    """Short headings of a figure's column; "" where it is not shown.

    `table` is of `vbaa-bench table`, `report` of the report and of the scores in the terminal.
    """

    table: str = ""
    report: str = ""


@dataclass(frozen=True, eq=False)
class Statistic:
    """Statistic of frames; `term` is null for a frame that does not count.

    Only frames that meet `where` count. The value is null if no frame counts, and unless the frames
    together meet `defined`. It is divided by the statistic `over`, and null if that is zero.
    `in_percent` multiplies it by 100. `null` says in the data dictionary when it is null, and
    `heading` what is above it in tables.
    """

    meaning: str
    reduction: Reduction
    term: pl.Expr
    where: pl.Expr | None = None
    defined: pl.Expr | None = None
    over: "Statistic | None" = None
    in_percent: bool = False
    null: str = ""
    heading: Heading = Heading()  # noqa: RUF009  (a named tuple cannot change)

    def headed(self, table: str = "", report: str = "") -> "Statistic":
        """Return the statistic with these headings, see `Heading`."""
        return replace(self, heading=Heading(table, report))

    def of(self, rows: pl.DataFrame) -> float | None:
        """Compute the statistic of rows of the scores."""
        return compute({"value": self}, rows)["value"]

    @property
    def values(self) -> pl.Expr:
        """The terms of the frames that count, as numbers."""
        values = self.term.cast(pl.Float64)
        return values if self.where is None else values.filter(self.where)

    @property
    def expression(self) -> pl.Expr:
        """The statistic as an expression, for queries of many groups of rows."""
        value = self.reduction.expression(self.values)
        if self.over is not None:
            divisor = self.over.expression
            value /= pl.when(divisor != 0).then(divisor)
        if self.in_percent:
            value *= 100
        return value if self.defined is None else pl.when(self.defined).then(value)


def compute(statistics: Mapping[str, Statistic], rows: pl.DataFrame) -> dict[str, float | None]:
    """Compute statistics of rows of the scores by name, in one query."""
    divisors = {f"{name} over": one.over for name, one in statistics.items() if one.over}
    of_all = {**divisors, **statistics}
    terms = {name: one.values.drop_nulls().implode() for name, one in of_all.items()}
    defined = {
        f"{name} defined": one.defined for name, one in of_all.items() if one.defined is not None
    }
    found = rows.select(**terms, **defined)
    values: dict[str, float | None] = {}
    for name, one in of_all.items():
        numbers = found[name].item().to_numpy()
        value = one.reduction.empty
        if f"{name} defined" in defined and not found[f"{name} defined"].item():
            value = None
        elif len(numbers):
            value = one.reduction.of(numbers)
        if f"{name} over" in divisors and value is not None:
            divisor = values[f"{name} over"]
            value = value / divisor if divisor else None
        values[name] = 100 * value if one.in_percent and value is not None else value
    return {name: values[name] for name in statistics}


# Names of statistics of errors: of their order, and averages, which have bootstrap intervals in
# strata.csv. Averages that are listed together are over the same frames.
ORDERS: Final = ("median_abs", "p95_abs", "worst_abs")
AVERAGES: Final = (
    ("bias", "rmse"),
    ("bias_over_limit", "rmse_over_limit"),
    ("coverage_68", "coverage_95", "nees"),
)
_NOT_STATED: Final = "no sigma is stated, or no limit was computed"


def coverage(quantity: ScoredQuantity, sigmas: float) -> Statistic:
    """Return the share of a quantity's errors within a number of stated sigmas."""
    within = pl.col(quantity.in_sigmas).abs() <= sigmas
    unit = "one stated sigma" if sigmas == 1 else f"{sigmas:g} stated sigmas"
    expected = f"{2 * ndtr(sigmas) - 1:.3f}".rstrip("0")
    meaning = f"share of errors within {unit}; {expected} if these are right"
    return Statistic(meaning, MEAN, within, null=_NOT_STATED)


@functools.cache
def error_statistics(quantity: ScoredQuantity) -> dict[str, Statistic]:
    """Return the statistics of a quantity's errors by name."""
    error, in_sigmas = pl.col(quantity.error), pl.col(quantity.in_sigmas)
    limit = pl.col(quantity.limit) if quantity in LIMITED else pl.lit(None, pl.Float64)
    stated = in_sigmas.is_not_null()
    return {
        "median_abs": Statistic("median of the absolute error", MEDIAN, error.abs()),
        "p95_abs": Statistic("95th percentile of the absolute error", P95, error.abs()),
        "worst_abs": Statistic("largest absolute error", LARGEST, error.abs()),
        "bias": Statistic("mean error", MEAN, error),
        "rmse": Statistic("root mean square error", RMS, error),
        "bias_over_limit": Statistic(
            "mean of error over information limit, frame by frame",
            MEAN,
            error / limit,
            null=_NOT_STATED,
        ),
        "rmse_over_limit": Statistic(
            "root mean square of error over information limit, frame by frame",
            RMS,
            error / limit,
            null=_NOT_STATED,
        ),
        "coverage_68": coverage(quantity, COVERAGE["coverage_68"]),
        "coverage_95": coverage(quantity, COVERAGE["coverage_95"]),
        "within_3_sigma": coverage(quantity, CONSISTENT_SIGMAS),
        "nees": Statistic(
            "mean squared error in stated sigmas; 1 if these are right",
            MEAN,
            in_sigmas**2,
            null=_NOT_STATED,
        ),
        # 1 if all frames have the same sigma and these are right, else less.
        "sigma_over_rmse": Statistic(
            "mean stated sigma over RMSE",
            MEAN,
            pl.col(quantity.sigma),
            where=stated,
            over=Statistic("", RMS, error, where=stated),
            null="no sigma is stated, or all errors are 0",
        ),
    }


_TIME: Final = pl.col("image_ms")
TIMES: Final = {
    "ms_median": Statistic("median of image_ms", MEDIAN, _TIME, null="no time is stated"),
    "ms_p05": Statistic("5th percentile of image_ms", P05, _TIME, null="no time is stated"),
    "ms_p95": Statistic("95th percentile of image_ms", P95, _TIME, null="no time is stated"),
}

_TOUCHED: Final = ~pl.col("free")
_ANSWERS: Final = pl.col("outcome").is_in(CONTACTS)
_FRAME: Final = pl.col("outcome").is_not_null()
_X_C_PCT: Final = pl.col("x_c_error_pct_L")
_SECOND_STATED: Final = pl.col(SECOND_S_C.column).is_not_null()
_SECOND_TRUE: Final = pl.col(SECOND_S_C.truth).is_not_null()
_RIGID: Final = _TOUCHED & pl.col("k_s_n_m").is_null()

# Shares above 100 % by more than this many sigmas of chance are not stated. Chosen.
_CHANCE_SIGMAS: Final = 3.0


def information_used(in_limits: pl.Expr) -> Statistic:
    """Return the share of the information that a method uses, from errors over limits.

    It is undefined where the errors are smaller than the limits by more than chance explains. The
    limit is then that of other data or of a worse rig, as where the rig states a wider range of
    beams than that from which this one is; a share of it has no meaning.
    """
    # The relative standard deviation of a sum of n squares of Gaussian errors.
    least = 1 - _CHANCE_SIGMAS * (2 / in_limits.count()).sqrt()
    possible = RMS.expression(in_limits) ** 2 > pl.max_horizontal(least, 0)
    meaning = "share of the information in its data that the method uses"
    return Statistic(meaning, INFORMATION_USED, in_limits, defined=possible)


_EFFICIENCY: Final = information_used(pl.col(X_C.error) / pl.col(X_C.limit))

# A method that estimates x_c without any sigma is neither consistent nor inconsistent.
MAY_BE_CONSISTENT: Final = (
    pl.col(X_C.error).is_null().all()
    | (pl.col(X_C.error).is_not_null() & pl.col(X_C.sigma).is_not_null()).any()
)


def _rms(column: str, meaning: str, where: pl.Expr | None = None) -> Statistic:
    return Statistic(f"root mean square {meaning}", RMS, pl.col(column), where)


def _median(column: str, meaning: str) -> Statistic:
    return Statistic(f"median absolute {meaning}", MEDIAN, pl.col(column).abs())


def _stated(quantity: ScoredQuantity, figure: str) -> Statistic:
    return error_statistics(quantity)[figure]


_OVER_LIMIT: Final = {
    f"{quantity.name}_{figure}": _stated(quantity, figure)
    for quantity in LIMITED
    for figure in ("bias_over_limit", "rmse_over_limit")
}
# Those with a heading.
_OVER_LIMIT_HEADED: Final = {
    "x_c_bias_over_limit": ("x_c bias / bound",),
    "x_c_rmse_over_limit": ("x_c RMSE / bound", "RMSE over limit"),
    "force_rmse_over_limit": ("force RMSE / bound",),
    "psi_rmse_over_limit": ("psi RMSE / bound",),
    "compliance_rmse_over_limit": ("1/k RMSE / bound",),
}
# RMSEs of the computed scores that have a heading.
ADDED: Final = {
    name.replace("_error", "_rmse"): _rms(name, score.column.meaning).headed(
        score.heading, score.heading
    )
    for name, score in COMPUTED.items()
    if score.heading
}
# The figures of a method in the summary, of all its frames.
SUMMARY: Final = {
    "x_c_rmse_pct_L": _rms("x_c_error_pct_L", "error of the contact distance").headed(
        "x_c RMSE, % of L", "x_c RMSE, % of L"
    ),
    # Null for a method that estimates only forces.
    "x_c_rmse_all_pct_L": Statistic(
        "the same RMSE; a failure counts as an error of L/2",
        RMS,
        _X_C_PCT.fill_null(FAILURE_ERROR_PCT_L),
        where=_TOUCHED & ~pl.col("rightly_refused"),
        defined=_X_C_PCT.is_not_null().any() | pl.col("force_error_n").is_null().all(),
    ).headed("failures as L/2", "RMSE, failures as L/2"),
    "x_c_median_abs_pct_L": _median("x_c_error_pct_L", "error of the contact distance").headed(
        "median", "x_c median |error|, % of L"
    ),
    "x_c_p95_abs_pct_L": Statistic("95th percentile of this error", P95, _X_C_PCT.abs()).headed(
        report="95th percentile"
    ),
    "s_c_rmse_pct_L": _rms("s_c_error_pct_L", "error of the contact arc length"),
    "force_rmse_pct": _rms(
        "force_error_pct",
        "error of the force, relative to its true value",
    ).headed("force, %", "force RMSE, %"),
    "force_median_abs_pct": _median("force_error_pct", "error of the force"),
    "f_rmse_pct": _rms("f_error_pct", "error of the force's component in plane D"),
    "theta_c_rmse_deg": _rms("theta_c_error_deg", "error of the slope at the contact"),
    "second_s_c_rmse_pct_L": _rms(
        "second_s_c_error_pct_L", "error of the second arc length"
    ).headed("second s_c RMSE, % of L"),
    "second_force_rmse_pct": _rms("second_force_error_pct", "error of the second force").headed(
        "second force, %"
    ),
    # Both are null for a method that never states a second contact.
    "second_detection_rate": Statistic(
        "share of the frames with two contacts in which the second one is stated",
        MEAN,
        _SECOND_STATED,
        where=_SECOND_TRUE,
        defined=_SECOND_STATED.any(),
    ),
    "false_second_rate": Statistic(
        "share of the other frames in which a second contact is stated",
        MEAN,
        _SECOND_STATED,
        where=~_SECOND_TRUE,
        defined=_SECOND_STATED.any(),
    ),
    "psi_rmse_deg": _rms("psi_error_deg", "error of the plane of bending").headed(
        "psi, deg", "psi RMSE, deg"
    ),
    "psi_median_abs_deg": _median("psi_error_deg", "error of the plane of bending"),
    "motor_angle_rmse_deg": _rms("motor_angle_error_deg", "error of the motor angle"),
    "compliance_rmse_pct": _rms(
        "compliance_error_pct",
        "error of 1/k_s, relative to its true value",
    ).headed(report="1/k_s RMSE, %"),
    "compliance_median_abs_pct": _median("compliance_error_pct", "error of 1/k_s"),
    "compliance_last_rmse_pct": _rms(
        "compliance_error_pct",
        "error of 1/k_s at the end of a push",
        pl.col("last_step"),
    ).headed("1/k at end of push, %"),
    "compliance_rigid_rmse_mm_per_n": _rms(
        "compliance_error_mm_per_n", "error of 1/k_s of rigid objects", _RIGID
    ),
    "compliance_rigid_last_rmse_mm_per_n": _rms(
        "compliance_error_mm_per_n",
        "error of 1/k_s of rigid objects at the end of a push",
        _RIGID & pl.col("last_step"),
    ).headed("1/k at end, rigid, mm/N"),
    "contact_antenna_rmse_mm": _rms(
        "contact_antenna_vector_error_mm", "error of the contact in Sigma_a"
    ),
    "contact_world_rmse_mm": _rms(
        "contact_world_vector_error_mm", "error of the contact in Sigma_o"
    ),
    "force_vector_rmse_n": _rms("force_vector_error_n", "error of the force as a vector"),
    **_OVER_LIMIT,
    **{name: _OVER_LIMIT[name].headed(*heads) for name, heads in _OVER_LIMIT_HEADED.items()},
    "failure_rate": Statistic(
        "share of frames without the required values, or with a wrong outcome",
        MEAN,
        pl.col("failed"),
    ).headed(report="failed, %"),
    "refused_rate": Statistic("share of frames refused", MEAN, pl.col("refused")),
    "rightly_refused_rate": Statistic(
        "share of frames refused rightly", MEAN, pl.col("rightly_refused")
    ),
    "crashed_rate": Statistic("share of frames without any prediction", MEAN, pl.col("crashed")),
    "consistent_rate": Statistic(
        "share of frames that are consistent or rightly refused",
        MEAN,
        pl.col("consistent"),
        defined=MAY_BE_CONSISTENT,
    ),
    "false_contact_rate": Statistic(
        "share of the frames without contact in which one is stated",
        MEAN,
        _ANSWERS,
        where=pl.col("free"),
    ),
    "free_frames": Statistic("frames without contact", COUNT, _FRAME, where=pl.col("free")),
    "detection_rate": Statistic(
        f"share of the contacts with an SNR of {THRESHOLDS.sure_snr:g} or more that are stated",
        MEAN,
        _ANSWERS,
        where=_TOUCHED & (pl.col("snr") >= THRESHOLDS.sure_snr),
    ),
    "ms_per_frame_median": Statistic(
        "median time from the image in memory to the estimate", MEDIAN, _TIME
    ).headed("ms", "ms per frame"),
    "ms_per_frame_p05": TIMES["ms_p05"],
    "ms_per_frame_p95": TIMES["ms_p95"],
    "n": Statistic("frames", COUNT, _FRAME).headed(report="frames"),
    **ADDED,
}


def _in_percent(one: Statistic, table: str, report: str = "") -> Statistic:
    return replace(one, in_percent=True).headed(table, report)


# Further figures of a method in the table of accuracy.
TABLE: Final = {
    "x_c_within_3_sigma_pct": _in_percent(_stated(X_C, "within_3_sigma"), "x_c in 3 sigma, %"),
    "psi_within_3_sigma_pct": _in_percent(_stated(PSI, "within_3_sigma"), "psi in 3 sigma, %"),
    "compliance_last_within_3_sigma_pct": _in_percent(
        replace(_stated(COMPLIANCE, "within_3_sigma"), where=pl.col("last_step")),
        "1/k at end in 3 sigma, %",
    ),
    "second_s_c_within_3_sigma_pct": _in_percent(
        _stated(SECOND_S_C, "within_3_sigma"), "second s_c in 3 sigma, %"
    ),
    "x_c_sigma_over_rmse": _stated(X_C, "sigma_over_rmse").headed("sigma / RMSE"),
    "second_s_c_sigma_over_rmse": _stated(SECOND_S_C, "sigma_over_rmse").headed(
        "second sigma / RMSE"
    ),
    "x_c_coverage_95_pct": _in_percent(
        _stated(X_C, "coverage_95"), "x_c in 1.96 sigma, %", "in 95 % interval, %"
    ),
    "x_c_efficiency_pct": _in_percent(_EFFICIENCY, "information used, %", "information used, %"),
    "second_answered_pct": _in_percent(SUMMARY["second_detection_rate"], "second answered, %"),
    "second_false_pct": _in_percent(SUMMARY["false_second_rate"], "second false, %"),
    "consistent_pct": _in_percent(SUMMARY["consistent_rate"], "consistent, %"),
}

# The figures of a method in the sentence and the charts of the report, by the names of
# `MethodStatistics`.
REPORTED: Final = {
    "frames": SUMMARY["n"],
    "contacts": Statistic("frames with contact", COUNT, _FRAME, where=_TOUCHED),
    "free": SUMMARY["free_frames"],
    "answered": Statistic(
        "contacts with an estimate", COUNT, _FRAME, where=_TOUCHED & ~pl.col("failed")
    ),
    "right_refusals": Statistic(
        "contacts that are rightly refused",
        COUNT,
        _FRAME,
        where=_TOUCHED & pl.col("rightly_refused"),
    ),
    "false_contacts": Statistic(
        "free frames with an estimate", COUNT, _FRAME, where=pl.col("free") & _ANSWERS
    ),
    "median": SUMMARY["x_c_median_abs_pct_L"],
    "ms": SUMMARY["ms_per_frame_median"],
}
# The figures of the report's table of scores, in the order of its columns.
REPORT_TABLE: Final = {
    "median": SUMMARY["x_c_median_abs_pct_L"],
    "ms": SUMMARY["ms_per_frame_median"],
    "rmse": SUMMARY["x_c_rmse_pct_L"],
    "rmse_over_limit": SUMMARY["x_c_rmse_over_limit"],
    "efficiency": TABLE["x_c_efficiency_pct"],
    "coverage_95": TABLE["x_c_coverage_95_pct"],
    "force_rmse": SUMMARY["force_rmse_pct"],
    "psi_rmse": SUMMARY["psi_rmse_deg"],
    "compliance_rmse": SUMMARY["compliance_rmse_pct"],
    "bias": Statistic("mean error of x_c", MEAN, _X_C_PCT).headed(report="bias"),
    "p95": SUMMARY["x_c_p95_abs_pct_L"],
    "worst": Statistic("largest absolute error of x_c", LARGEST, _X_C_PCT.abs()).headed(
        report="worst frame"
    ),
    "rmse_all": SUMMARY["x_c_rmse_all_pct_L"],
    **ADDED,
}

# The figures of a group of frames in factors.csv.
_UNANSWERED: Final = "no frame is answered"
FACTOR: Final = {
    "frames": Statistic("number of frames in the group", COUNT, _FRAME).headed(report="frames"),
    "answered_pct": Statistic(
        "share of the frames with a contact and values", MEAN, 100 * _ANSWERS
    ).headed(report="answered, %"),
    "median_pct_L": Statistic(
        "median of the absolute error of x_c", MEDIAN, _X_C_PCT.abs(), null=_UNANSWERED
    ).headed(report="median |error|, % of L"),
    "rmse_pct_L": Statistic(
        "root mean square error of x_c", RMS, _X_C_PCT, null=_UNANSWERED
    ).headed(report="RMSE, % of L"),
    "consistent_pct": Statistic(
        "share of the consistent frames", MEAN, 100 * pl.col("consistent")
    ).headed(report="consistent, %"),
}

# SNR above which a contact should be found. From the requirement on collections.
_CLEAR_SNR: Final = 10.0
# Further figures of a method in the summary of a collection.
COLLECTION: Final = {
    "x_c_rms_in_sigmas": Statistic(
        "root mean square error of x_c in stated sigmas; 1 if these are right",
        RMS,
        pl.col(X_C.in_sigmas),
    ),
    "detection_rate_snr_10": Statistic(
        "share of the contacts with an SNR above 10 that are stated",
        MEAN,
        _ANSWERS,
        where=_TOUCHED & (pl.col("snr") > _CLEAR_SNR),
    ),
}
