"""The benchmark as a Croissant task: problem, form of the answer, rules and evaluation.

Source: the vocabulary and the SHACL shapes of Croissant Tasks (github.com/mlcommons/croissant,
folder tasks; Benjelloun et al., arXiv 2605.29786, 2026).
"""

from typing import Final

from vbaa_bench.dataset.column import unit
from vbaa_bench.exports.croissant_document import CONTEXT, Node
from vbaa_bench.scoring.columns import PREDICTIONS

_TEXTS: Final = ("frame_id", "outcome", "message", "information")
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
# Names, units and definitions of the metrics.
METRICS: Final = (
    ("x_c_rmse_pct_L", "% of L", "root mean square error of the contact distance"),
    ("x_c_median_abs_pct_L", "% of L", "median absolute error of the contact distance"),
    ("x_c_rmse_all_pct_L", "% of L", "the same RMSE; a failure counts as an error of L/2"),
    ("force_rmse_pct", "%", "root mean square error of the force, relative to its true value"),
    ("psi_rmse_deg", "deg", "root mean square error of the plane of bending"),
    ("compliance_rmse_pct", "%", "root mean square error of 1/k_s, relative to its true value"),
    ("rmse_over_limit", "1", "root mean square of error over information limit"),
    ("coverage_95", "1", "share of errors within 1.96 stated standard deviations; right is 0.95"),
    ("nees", "1", "mean squared error in stated standard deviations; right is 1"),
    ("consistent_rate", "1", "share of frames that are consistent or rightly refused"),
    ("failure_rate", "1", "share of frames without the required values, or with a wrong outcome"),
    ("ms_per_frame_median", "ms", "median time from the image in memory to the estimate"),
)


def task(dataset: str) -> Node:
    """Describe the task whose input is the Croissant document `dataset`, a relative path."""
    fields = [
        {
            "@type": "cr:Field",
            "@id": f"predictions/{name}",
            "name": name,
            "description": " ".join(
                filter(None, (column.meaning, f"[{unit(name)}]" if unit(name) else ""))
            ),
            "dataType": "sc:Text" if name in _TEXTS else "cr:Float64",
        }
        for name, column in PREDICTIONS.items()
    ]
    metrics = [
        {"@type": "sc:PropertyValue", "name": name, "unitText": unit_, "description": text}
        for name, unit_, text in METRICS
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
