"""Summary of scores: one record per method."""

import os
import platform
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from solver.instrument.arrays import Floats
from solver.instrument.estimate import Outcome
from vbaa_bench.dataset.manifest import versions
from vbaa_bench.scoring.bootstrap import group_numbers, median_interval
from vbaa_bench.scoring.efficiency import efficiency
from vbaa_bench.scoring.parameters import ALL
from vbaa_bench.scoring.refusals import SURE_SNR
from vbaa_bench.scoring.scored_quantities import (
    COMPLIANCE,
    COMPONENTS,
    COVERAGE,
    LIMITED,
    SCORED_QUANTITIES,
    ScoredQuantity,
)

CONTACTS = [str(outcome) for outcome in Outcome if outcome.has_values]
# Chosen: the largest error of guessing the middle of the beam, so that leaving a frame out is no
# advantage for a method that is better than this guess.
_FAILURE_ERROR_PCT_L = 50.0


def summarise(
    scores: pl.DataFrame,
    parameters: Sequence[dict[str, Any]] = (),
    over: Sequence[str] | None = None,
) -> dict[str, Any]:
    """Summarise errors, failure rate and time as `methods.<name>`; add machine and versions.

    Failures count in `failure_rate` and `n`; errors are computed from frames with an estimate, null
    if there is none. Intervals are 95 % bootstrap intervals of the medians over pushes, or over
    groups of the columns `over`. From `parameters`, the rows of `parameter_rows`, each method gets
    its `parameters` by quantity over all frames, and its `efficiency` by quantity.
    """
    methods = {
        str(name): summarise_method(rows)
        | _intervals(rows, over)
        | _parameters(rows, [row for row in parameters if row["method"] == name])
        for (name,), rows in scores.group_by("method", maintain_order=True)
    }
    return {"methods": methods, "machine": machine(), "versions": versions()}


def _parameters(rows: pl.DataFrame, parameters: Sequence[dict[str, Any]]) -> dict[str, Any]:
    overall = {row["quantity"]: row for row in parameters if row["stratum"] == ALL}
    heads = ("method", "stratum", "value", "quantity")
    (information, *others) = rows["information"].unique(maintain_order=True)
    used = {
        quantity.column: efficiency(information, overall[quantity.column])
        for quantity in LIMITED
        # Frames of different information sets have no share in common.
        if quantity.column in overall and not others
    }
    return {
        "parameters": {
            quantity: {key: value for key, value in row.items() if key not in heads}
            for quantity, row in overall.items()
        },
        "efficiency": {quantity: share for quantity, share in used.items() if share},
    }


def summarise_method(rows: pl.DataFrame) -> dict[str, Any]:
    """Summarise frames of one method, without bootstrap intervals.

    Rates are fractions of all frames, with two exceptions: `false_contact_rate` is a fraction of
    the frames without contact, and `detection_rate` of the frames with contact and an SNR of
    SURE_SNR or more; both are null if there are no such frames. `refused_rate` counts outcomes that
    state no values, `rightly_refused_rate` those of them that are right, `crashed_rate` frames
    without any prediction; all three are part of `failure_rate`. `consistent_rate` is the fraction
    of consistent frames, with a right outcome or an x_c within three stated sigmas; null if no
    sigma is stated.
    `second_detection_rate` is the fraction of the frames with two contacts in which the second one
    is stated, `false_second_rate` that of the others; null if it never is.
    `x_c_rmse_all_pct_L` is an RMSE in which a frame without an estimate counts as an error of half
    the beam's length, unless it has no contact or is rightly refused; null for a method that
    estimates only forces. `compliance_last_rmse_pct` and other `last` values are computed from the
    last frames of pushes. `<quantity>_bias_over_limit` and `<quantity>_rmse_over_limit` are the
    mean and the root mean square of errors over information limits, null without limits.
    `outcome_confusion` counts outcomes by the true state of the frame, `refusals.right_refusals`.
    """
    x_c, force = np.abs(_values(rows, "x_c_error_pct_L")), _values(rows, "force_error_pct")
    psi, compliance = _values(rows, "psi_error_deg"), _values(rows, "compliance_error_pct")
    times, with_contact = _values(rows, "image_ms"), rows.filter(~pl.col("free"))
    detectable = with_contact.filter(pl.col("snr") >= SURE_SNR)
    last, rigid = rows.filter("last_step"), with_contact.filter(pl.col("k_s_n_m").is_null())
    counts = rows["outcome"].value_counts(sort=True)
    return {
        "x_c_rmse_pct_L": _rms(x_c),
        "x_c_rmse_all_pct_L": _rmse_all(with_contact),
        "x_c_median_abs_pct_L": _quantile(x_c, 0.5),
        "x_c_p95_abs_pct_L": _quantile(x_c, 0.95),
        "s_c_rmse_pct_L": _rms(_values(rows, "s_c_error_pct_L")),
        "force_rmse_pct": _rms(force),
        "force_median_abs_pct": _quantile(np.abs(force), 0.5),
        "f_rmse_pct": _rms(_values(rows, "f_error_pct")),
        "theta_c_rmse_deg": _rms(_values(rows, "theta_c_error_deg")),
        "second_s_c_rmse_pct_L": _rms(_values(rows, "second_s_c_error_pct_L")),
        "second_force_rmse_pct": _rms(_values(rows, "second_force_error_pct")),
        **_second_rates(rows),
        "psi_rmse_deg": _rms(psi),
        "psi_median_abs_deg": _quantile(np.abs(psi), 0.5),
        "motor_angle_rmse_deg": _rms(_values(rows, "motor_angle_error_deg")),
        "compliance_rmse_pct": _rms(compliance),
        "compliance_median_abs_pct": _quantile(np.abs(compliance), 0.5),
        "compliance_last_rmse_pct": _rms(_values(last, "compliance_error_pct")),
        "compliance_rigid_rmse_mm_per_n": _rms(_values(rigid, "compliance_error_mm_per_n")),
        "compliance_rigid_last_rmse_mm_per_n": _rms(
            _values(rigid.filter("last_step"), "compliance_error_mm_per_n")
        ),
        "contact_antenna_rmse_mm": _rms(_values(rows, "contact_antenna_vector_error_mm")),
        "contact_world_rmse_mm": _rms(_values(rows, "contact_world_vector_error_mm")),
        "force_vector_rmse_n": _rms(_values(rows, "force_vector_error_n")),
        **_over_limits(rows),
        "calibration": {
            **{
                quantity.name: calibration(rows, quantity)
                for quantity in (*SCORED_QUANTITIES, *COMPONENTS)
            },
            "compliance_rigid": calibration(rigid, COMPLIANCE),
            "compliance_last": calibration(last, COMPLIANCE),
        },
        "failure_rate": _fraction(rows, "failed"),
        "refused_rate": _fraction(rows, "refused"),
        "rightly_refused_rate": _fraction(rows, "rightly_refused"),
        "crashed_rate": _fraction(rows, "crashed"),
        "consistent_rate": _consistent_rate(rows),
        "false_contact_rate": _fraction(rows.filter("free"), pl.col("outcome").is_in(CONTACTS)),
        "free_frames": rows.height - with_contact.height,
        "detection_rate": _fraction(detectable, pl.col("outcome").is_in(CONTACTS)),
        "outcomes": dict(counts.iter_rows()),
        "outcome_confusion": _confusion(rows),
        "ms_per_frame_median": _quantile(times, 0.5),
        "ms_per_frame_p05": _quantile(times, 0.05),
        "ms_per_frame_p95": _quantile(times, 0.95),
        "n": rows.height,
    }


def calibration(rows: pl.DataFrame, one: ScoredQuantity) -> dict[str, Any] | None:
    """Compare stated standard deviations with errors; return None if none is stated.

    For consistent Gaussian errors `coverage_68`, the fraction within one sigma, is 0.683,
    `coverage_95`, within 1.96 sigmas, 0.95, `within_3_sigma` 0.997 and `nees`, the mean squared
    error in sigmas, 1. `sigma_over_rmse` is the mean stated sigma over the RMSE: 1 if all frames
    have the same sigma, else less.
    """
    stated = rows.drop_nulls([one.in_sigmas, one.error, one.sigma])
    if stated.is_empty():
        return None
    error, in_sigmas = _values(stated, one.error), np.abs(_values(stated, one.in_sigmas))
    rmse, sigma = _rms(error), float(np.mean(_values(stated, one.sigma)))
    return {
        "n": stated.height,
        **{name: float(np.mean(in_sigmas <= sigmas)) for name, sigmas in COVERAGE.items()},
        "within_3_sigma": float(np.mean(in_sigmas <= 3)),
        "nees": float(np.mean(in_sigmas**2)),
        "sigma_over_rmse": sigma / rmse if rmse else None,
    }


def _second_rates(rows: pl.DataFrame) -> dict[str, float | None]:
    """Compute the fractions of frames with and without a second contact that state one.

    Both are None for a method that never states a second contact.
    """
    stated, true = pl.col("second_s_c_mm").is_not_null(), pl.col("true_second_s_c_mm").is_not_null()
    never = rows.filter(stated).is_empty()
    return {
        "second_detection_rate": None if never else _fraction(rows.filter(true), stated),
        "false_second_rate": None if never else _fraction(rows.filter(~true), stated),
    }


def _consistent_rate(rows: pl.DataFrame) -> float | None:
    """Compute the fraction of consistent frames; None if x_c is estimated without any sigma."""
    answered = rows.drop_nulls("x_c_error_mm")
    without_sigma = answered.height > 0 and answered["x_c_sigma_mm"].is_null().all()
    return None if without_sigma else _fraction(rows, "consistent")


def _rmse_all(with_contact: pl.DataFrame) -> float | None:
    """Compute the RMSE of x_c over all frames in `with_contact` that are not rightly refused.

    A frame without an estimate counts as _FAILURE_ERROR_PCT_L. Return None for a method that
    estimates only forces.
    """
    if with_contact["x_c_error_pct_L"].is_null().all() and with_contact["force_error_n"].count():
        return None
    required = with_contact.filter(~pl.col("rightly_refused"))
    return _rms(required["x_c_error_pct_L"].fill_null(_FAILURE_ERROR_PCT_L).to_numpy())


def _fraction(rows: pl.DataFrame, condition: str | pl.Expr) -> float | None:
    """Compute the fraction of rows that meet a condition; return None if there are no rows."""
    return None if rows.is_empty() else rows.filter(condition).height / rows.height


def _over_limits(rows: pl.DataFrame) -> dict[str, float | None]:
    figures: dict[str, float | None] = {}
    for quantity in LIMITED:
        errors = rows.select(pl.col(quantity.error) / pl.col(quantity.limit)).to_series()
        in_limits = _known(errors)
        figures[f"{quantity.name}_bias_over_limit"] = (
            float(np.mean(in_limits)) if len(in_limits) else None
        )
        figures[f"{quantity.name}_rmse_over_limit"] = _rms(in_limits)
    return figures


def _confusion(rows: pl.DataFrame) -> dict[str, dict[str, int]]:
    """Count the outcomes by true state; a frame without a prediction counts as crashed."""
    counts = rows.group_by("true_state", "outcome").len().sort("true_state", "outcome")
    confusion: dict[str, dict[str, int]] = {}
    for state, outcome, count in counts.iter_rows():
        confusion.setdefault(state, {})[outcome] = count
    return confusion


def _intervals(rows: pl.DataFrame, over: Sequence[str] | None) -> dict[str, Any]:
    groups = group_numbers(rows, over)
    intervals = {}
    for name in ("x_c_error_pct_L", "image_ms"):
        known = rows[name].is_not_null().to_numpy()
        intervals[name] = median_interval(_known(rows[name]), groups[known])
    return {
        "x_c_median_abs_pct_L_95": _listed(intervals["x_c_error_pct_L"]),
        "ms_per_frame_median_95": _listed(intervals["image_ms"]),
    }


def _listed(ends: Sequence[float] | None) -> list[float] | None:
    return None if ends is None else list(ends)


def machine() -> dict[str, Any]:
    """Describe the machine on which times were measured: processor, cores and system."""
    model = platform.processor() or platform.machine()
    listing = Path("/proc/cpuinfo")
    if listing.is_file():
        names = [
            line.partition(":")[2].strip()
            for line in listing.read_text(encoding="utf-8").splitlines()
            if line.startswith("model name")
        ]
        model = names[0] if names else model
    system = f"{platform.system()} {platform.machine()}"
    return {"processor": model, "cores": os.cpu_count(), "system": system}


def _values(rows: pl.DataFrame, column: str) -> Floats:
    return _known(rows[column])


def _known(values: pl.Series) -> Floats:
    return np.asarray(values.drop_nulls().to_numpy(), dtype=np.float64)


def _rms(values: Floats) -> float | None:
    return float(np.sqrt(np.mean(values**2))) if len(values) else None


def _quantile(values: Floats, probability: float) -> float | None:
    return float(np.quantile(values, probability)) if len(values) else None
