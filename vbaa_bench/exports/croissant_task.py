"""The benchmark as a Croissant task: problem, form of the answer, rules and evaluation.

Source: the vocabulary and the SHACL shapes of Croissant Tasks (github.com/mlcommons/croissant,
folder tasks; Benjelloun et al., arXiv 2605.29786, 2026).
"""

from typing import Final

from vbaa_bench.dataset.column import unit
from vbaa_bench.exports.croissant_document import CONTEXT, Node
from vbaa_bench.exports.croissant_texts import EVALUATION, METRICS, PROBLEM, RULES
from vbaa_bench.scoring.columns import PREDICTIONS

_TEXTS: Final = ("frame_id", "outcome", "message", "information")


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
