"""The benchmark as a Croissant task: problem, form of the answer, rules and evaluation.

Source: the vocabulary and the SHACL shapes of Croissant Tasks (github.com/mlcommons/croissant,
folder tasks; Benjelloun et al., arXiv 2605.29786, 2026).
"""

from typing import Final

from solver.instrument.units import unit_of
from vbaa_bench.exports.croissant_document import CONTEXT, TYPES, Node
from vbaa_bench.scoring.score_columns import PREDICTIONS
from vbaa_bench.scoring.scored_quantities import X_C
from vbaa_bench.scoring.statistics import SUMMARY, error_statistics

PROBLEM: Final = (
    "Estimate from each image of a bent beam where the beam touches an object (contact distance"
    " x_c), how hard (force), in which plane (psi) and how stiff the object is (k_s), with a "
    "standard deviation of each estimate; or state why no estimate is possible."
)
RULES: Final = (
    "A method receives rig.json, the board views, the rest images, the images of the frames and"
    " the readings, and nothing of the truth: neither labels, nor truth/manifest.json, nor the "
    "scene. It must not be tuned on the frames on which it is scored; frames of one push, and "
    "rigs of a split by rig, are never in two splits. Every frame is answered or counts as a "
    "failure."
)
EVALUATION: Final = (
    "Every frame is scored. Errors are computed from the frames with an estimate, and failures "
    "are counted beside them; a second RMSE counts a failure as an error of L/2. An outcome "
    "without values is right where the truth allows it. Honesty: an estimate is consistent if "
    "its error is at most three of its stated standard deviations; coverage at 68 and 95 % and "
    "NEES are reported with the errors. Errors are divided, frame by frame, by the information "
    "limit (Cramer and Rao), the least standard deviation without bias: 1 is the best possible "
    "RMSE over the limit. Intervals are 95 % bootstrap intervals over pushes."
)
# Statistics that are metrics of the task. One without a quantity in its name exists for each.
METRICS: Final = (
    "x_c_rmse_pct_L",
    "x_c_median_abs_pct_L",
    "x_c_rmse_all_pct_L",
    "force_rmse_pct",
    "psi_rmse_deg",
    "compliance_rmse_pct",
    "rmse_over_limit",
    "coverage_95",
    "nees",
    "consistent_rate",
    "failure_rate",
    "ms_per_frame_median",
)


def task(dataset: str) -> Node:
    """Describe the task whose input is the Croissant document `dataset`, a relative path."""
    fields = [
        {
            "@type": "cr:Field",
            "@id": f"predictions/{name}",
            "name": name,
            "description": " ".join(
                filter(
                    None, (column.meaning, f"[{unit_of(name).text}]" if unit_of(name).text else "")
                )
            ),
            "dataType": TYPES[column.kind.dtype],
        }
        for name, column in PREDICTIONS.items()
    ]
    statistics = {**SUMMARY, **error_statistics(X_C)}
    metrics = [
        {
            "@type": "sc:PropertyValue",
            "name": name,
            "unitText": "ms" if name.startswith("ms_") else unit_of(name).text or "1",
            "description": statistics[name].meaning,
        }
        for name in METRICS
    ]
    return {
        "@context": CONTEXT,
        "@type": "cr:TaskProblem",
        "@id": "vbaa-bench-task",
        "name": "Contact of a vision-based active antenna",
        "description": PROBLEM,
        "cr:input": {"@type": "sc:Dataset", "@id": dataset, "name": "The dataset"},
        "cr:output": {
            "@type": "cr:OutputSpec",
            "@id": "vbaa-bench-predictions",
            "name": "Predictions: one row per frame, as CSV or Parquet",
            "cr:schema": {
                "@type": "cr:RecordSet",
                "@id": "predictions",
                "name": "predictions",
                "key": {"@id": "predictions/frame_id"},
                "field": fields,
            },
        },
        "cr:implementation": {
            "@type": "cr:ImplementationSpec",
            "@id": "vbaa-bench-rules",
            "name": "Rules for a method",
            "description": RULES,
        },
        "cr:evaluation": {
            "@type": "cr:EvaluationSpec",
            "@id": "vbaa-bench-evaluation",
            "name": "Evaluation by `vbaa-bench score`",
            "description": EVALUATION,
            "variableMeasured": metrics,
        },
    }
