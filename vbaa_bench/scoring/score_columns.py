"""Columns of predictions, scores and the table of factors."""

from collections.abc import Mapping
from typing import Final

from solver.instrument.quantities import QUANTITIES
from vbaa_bench.dataset.column import FREE, SIGMA_A, SIGMA_D, SIGMA_O, Column, Kind, Presence
from vbaa_bench.dataset.dataset_columns import JOINED, TRUTH
from vbaa_bench.dataset.tables import schema_of
from vbaa_bench.scoring.computed_scores import COMPUTED, FAILED, VECTOR_ERRORS
from vbaa_bench.scoring.conditions import CONDITIONS, FACTOR_PREFIX, STRATA
from vbaa_bench.scoring.information_sets import SETS
from vbaa_bench.scoring.scored_quantities import (
    COMPONENTS,
    LIMITED,
    NUMBERS,
    SCORED_QUANTITIES,
    X_C,
)
from vbaa_bench.scoring.statistics import (
    AVERAGES,
    FACTOR,
    ORDERS,
    TIMES,
    Statistic,
    error_statistics,
)

_NOT_ESTIMATED: Final = "the method does not estimate it in this frame"
# A uniform beam and one contact without friction.
_SIMPLE: Final = "with the simple model"
_HOLDS: Final = "the limits were not computed, or the simple model holds"
_QUANTITIES: Final = (*SCORED_QUANTITIES, *COMPONENTS)
_SETS: Final = f"{', '.join([*SETS][:-1])} or {[*SETS][-1]}"

# Quantities that are not in the truth under the same name.
_ESTIMATES: Final = {
    **{
        f"contact_{name}_{axis}_mm": Column(f"{axis} of the contact point", frame)
        for name, frame in (("antenna", SIGMA_A), ("world", SIGMA_O))
        for axis in "xyz"
    },
    **{
        f"force_{axis}_n": Column(f"{axis} of the force of the object on the beam", SIGMA_A)
        for axis in "xyz"
    },
    **{
        f"displacement_{axis}_mm": Column(
            f"{axis} of the displacement of the beam at the contact (eqs. 28, 29)", SIGMA_A
        )
        for axis in "yz"
    },
    "second_force_n": Column("magnitude of the force of the second object", SIGMA_A),
    **{
        f"second_contact_antenna_{axis}_mm": Column(f"{axis} of the second contact point", SIGMA_A)
        for axis in "xyz"
    },
    **{
        f"second_force_{axis}_n": Column(
            f"{axis} of the force of the second object on the beam", SIGMA_A
        )
        for axis in "xyz"
    },
    "compliance_mm_per_n": Column("compliance 1/k_s of the object; of a rigid one 0"),
    "stiffness_n_per_m": Column("stiffness k_s, if the compliance is significantly above 0"),
    "friction": Column("friction coefficient between beam and object"),
    "object_radius_mm": Column("radius of the touched object; of an edge 0"),
    "onset_angle_deg": Column("motor angle at first contact", SIGMA_O),
    "motor_angle_deg": Column("estimated motor angle", SIGMA_O),
}


def _quantities() -> dict[str, Column]:
    columns = {}
    for quantity in QUANTITIES.values():
        described = _ESTIMATES.get(quantity.name) or TRUTH[quantity.name]
        columns[quantity.name] = described._replace(null=_NOT_ESTIMATED)
        columns[quantity.sigma_name] = Column(
            f"stated standard deviation of {quantity.name}", described.frame, _NOT_ESTIMATED
        )
    return columns


# Made by the solver, see solver/lab/table.py, with the time of the reference kernel.
PREDICTIONS: Final = {
    "frame_id": JOINED["frame_id"],
    "outcome": Column("outcome of the estimate, see solver/README.md", kind=Kind.TEXT),
    "message": Column("the reason for the outcome, as a sentence", kind=Kind.TEXT),
    "assumption": Column(
        "assumption that the image contradicts, one of those in the description of the format",
        "",
        "the outcome names none",
        kind=Kind.TEXT,
    ),
    **_quantities(),
    "x_c_force_correlation": Column("stated correlation of x_c_mm and force_n", "", _NOT_ESTIMATED),
    "x_c_y_c_correlation": Column("stated correlation of x_c_mm and y_c_mm", "", _NOT_ESTIMATED),
    "contact_world_x_y_correlation": Column(
        "stated correlation of contact_world_x_mm and contact_world_y_mm", SIGMA_O, _NOT_ESTIMATED
    ),
    "chi2": Column("sum of squared residuals in sigmas", "", _NOT_ESTIMATED),
    "dof": Column("degrees of freedom of chi2", "", _NOT_ESTIMATED),
    "iterations": Column("iterations of the fit", "", _NOT_ESTIMATED),
    "image_ms": Column("time from the image in memory to the estimate", "", "it was not measured"),
    "processor_ms": Column(
        "processor time from the image in memory to the estimate, the least of all repeats",
        "",
        "it was not measured",
    ),
    "reference_ms": Column(
        "processor time of a fixed computation after this frame, to compare processor_ms with",
        "",
        "it was not measured",
    ),
}


def _truths_and_errors() -> dict[str, Column]:
    columns = {}
    for quantity in _QUANTITIES:
        estimate = PREDICTIONS[quantity.column]
        columns[quantity.truth] = Column(f"true value of {quantity.column}", estimate.frame, FREE)
        columns[quantity.error] = Column(
            f"{quantity.column} minus its true value", estimate.frame, FAILED
        )
        columns[quantity.in_sigmas] = Column(
            f"this error over the stated standard deviation of {quantity.column}", "", FAILED
        )
    for quantity in LIMITED:
        columns[quantity.limit] = Column(
            f"information limit of {quantity.column}: least standard deviation without bias",
            PREDICTIONS[quantity.column].frame,
            "the limits were not computed, or the data do not determine it",
        )
    for name in ("true_stiffness_n_per_m", "true_friction", "true_object_radius_mm"):
        columns[name] = columns[name]._replace(null="the object does not have it")
    # The motor always has an angle.
    columns["true_motor_angle_deg"] = TRUTH["true_motor_angle_deg"]
    return columns


def _limits() -> dict[str, Column]:
    columns = {
        "frame_id": JOINED["frame_id"],
        "information": Column(
            f"information set: {_SETS}",
            kind=Kind.TEXT,
            presence=Presence.COMPLETE,
        ),
    }
    for quantity in LIMITED:
        described = PREDICTIONS[quantity.column]
        columns[quantity.limit] = Column(
            f"least standard deviation of {quantity.column} without bias (Cramer and Rao)",
            described.frame,
            "these data do not determine it",
            presence=Presence.PRESENT,
        )
    for kind, meaning in (("bias", "bias"), ("sigma", "standard deviation")):
        for name, unit in (("x_c", "mm"), ("s_c", "mm"), ("force", "n"), ("psi", "deg")):
            columns[f"{name}_simple_{kind}_{unit}"] = Column(
                f"{meaning} of {name}_{unit} {_SIMPLE} (White 1982)",
                PREDICTIONS[f"{name}_{unit}"].frame,
                "this model holds, or it does not fit",
                presence=Presence.PRESENT if name in ("x_c", "force") else Presence.OPTIONAL,
            )
    return columns


LIMITS: Final = _limits()
LIMIT_SCHEMA: Final = schema_of(LIMITS)


def _having(presence: Presence, columns: Mapping[str, Column]) -> dict[str, Column]:
    return {name: column._replace(presence=presence) for name, column in columns.items()}


_FLAGS: Final = {
    "last_step": "this is the last step of its push",
    "free": "nothing is touched",
    "failed": "required values are missing or the outcome is wrong",
    "crashed": "the method crashed or has no prediction",
    "refused": "the outcome states no values, although something is touched",
    "rightly_refused": "this refusal, and the assumption that it names, is right",
    "consistent": "x_c is within three stated sigmas, or a refusal is right",
}

SCORES: Final = {
    "frame_id": JOINED["frame_id"],
    **_having(Presence.PRESENT, {name: TRUTH[name] for name in CONDITIONS}),
    **_having(Presence.COMPLETE, {name: TRUTH[name] for name in ("push", "push_id", "step")}),
    **_having(Presence.PRESENT, {name: PREDICTIONS[name] for name in NUMBERS}),
    # Runs of older versions have no reference time: their times are not compared.
    "reference_ms": PREDICTIONS["reference_ms"],
    "outcome": PREDICTIONS["outcome"]._replace(presence=Presence.COMPLETE),
    "message": PREDICTIONS["message"]._replace(presence=Presence.PRESENT),
    "assumption": PREDICTIONS["assumption"],
    **_having(Presence.PRESENT, _truths_and_errors()),
    **{name: one.column for name, one in VECTOR_ERRORS.items()},
    "x_c_simple_rms_mm": Column(f"least RMS of errors of x_c {_SIMPLE}", SIGMA_D, _HOLDS),
    "force_simple_rms_n": Column(f"least RMS of errors of force_n {_SIMPLE}", SIGMA_A, _HOLDS),
    **{name: one.column for name, one in COMPUTED.items()},
    **{
        name: Column(meaning, kind=Kind.TEXT, presence=Presence.COMPLETE)
        for name, meaning in STRATA.items()
    },
    "information": Column(
        f"information set of the limits: {_SETS}",
        kind=Kind.TEXT,
        presence=Presence.COMPLETE,
    ),
    "true_state": Column(
        "contact, no contact, or the first reason for which a refusal is right",
        kind=Kind.TEXT,
        presence=Presence.COMPLETE,
    ),
    "snr": Column("signal-to-noise ratio of the bend in the image", presence=Presence.PRESENT),
    "method": Column(
        "method, with its centreline after @ if it is not the default",
        kind=Kind.TEXT,
        presence=Presence.COMPLETE,
    ),
    **{
        name: Column(f"whether {meaning}", kind=Kind.FLAG, presence=Presence.COMPLETE)
        for name, meaning in _FLAGS.items()
    },
    "rig": Column("number of the rig; absent for a single dataset", kind=Kind.INTEGER),
    f"{FACTOR_PREFIX}*": Column(
        "value of a factor in which rigs or frames differ; absent for a single dataset",
        "",
        "the rig has no such value",
    ),
}

SCORE_SCHEMA: Final = schema_of(SCORES)._replace(
    positive=tuple(quantity.limit for quantity in LIMITED)
)

# Columns of strata.csv. Its figures are in the unit of the row's quantity.
_ERRORS: Final = error_statistics(X_C)


def _figure(statistic: Statistic, frame: str = "") -> Column:
    return Column(statistic.meaning, frame, statistic.null)


def _with_interval(name: str) -> dict[str, Column]:
    statistic = _ERRORS[name]
    null = statistic.null or "frames of one push only"
    return {
        name: _figure(statistic),
        f"{name}_low": Column(f"2.5 % limit of {statistic.meaning}", "", null),
        f"{name}_high": Column(f"97.5 % limit of {statistic.meaning}", "", null),
    }


STRATA_TABLE: Final = {
    "method": SCORES["method"],
    "stratum": Column("column of the scores by which frames are classified, or all"),
    "value": Column("class of the frames"),
    "quantity": Column("column of the predictions; its suffix is the unit of the figures"),
    "frames": Column("number of frames in the class"),
    "failed": Column("frames that failed, among all of the class"),
    "crashed": Column("frames that crashed or have no prediction"),
    "refused": Column("frames whose outcome states no values, although something is touched"),
    "answered": Column("frames with an error of this quantity"),
    **{name: _figure(_ERRORS[name]) for name in ORDERS},
    "worst_frame": Column("frame_id of the largest absolute error"),
    **{
        column: c
        for names in AVERAGES
        for name in names
        for column, c in _with_interval(name).items()
    },
    "sigma_over_rmse": _figure(_ERRORS["sigma_over_rmse"]),
    **{name: _figure(statistic) for name, statistic in TIMES.items()},
}

# Columns of factors.csv.
FACTORS: Final = {
    "method": SCORES["method"],
    "factor": Column("name of the factor, as in the scores without its prefix"),
    "group": Column("range or value of the factor in this group of frames"),
    **{
        name: _figure(one, SIGMA_D if name.endswith("_pct_L") else "")
        for name, one in FACTOR.items()
    },
    "spread": Column("consistent_pct of the best group minus that of the worst, of the factor"),
}
