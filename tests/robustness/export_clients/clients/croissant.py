"""Read croissant.json with `mlcroissant`, and the task description with `rdflib`."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from tests.robustness.export_clients.clients.check import (
    Check,
    Rows,
    check,
    decoded,
    frame_key,
    labels,
    pixels,
)


def croissant(folder: Path, rows: Rows) -> Iterator[Check]:
    """Validate croissant.json, and load the frames that it describes."""
    import mlcroissant

    data = mlcroissant.Dataset(folder / "croissant.json")
    issues = data.metadata.ctx.issues
    yield check("errors of validation", 0, len(issues.errors))
    yield check("warnings of validation", 0, len(issues.warnings))
    records = [
        {name.partition("/")[2]: decoded(value) for name, value in record.items()}
        for record in data.records("frames")
    ]
    loaded_rows = {frame_key(rows, record): record for record in records}
    yield check("frames", len(rows), len(records))
    yield check("names of frames", set(rows), set(loaded_rows))
    yield labels(rows, loaded_rows)
    if "image" in records[0]:
        yield from pixels(rows, {key: np.array(row["image"]) for key, row in loaded_rows.items()})
    else:
        images = [decoded(record["images/file_name"]) for record in data.records("images")]
        names = sorted(f"{row['frame_id']}.png" for row in rows.values())
        yield check("names of images", names, sorted(images))
    yield _task(folder)


def _task(folder: Path) -> Check:
    """Test the task description against the rules of Croissant Tasks for a problem."""
    import rdflib

    graph = rdflib.Graph().parse(folder / "croissant_task.json", format="json-ld")
    cr = rdflib.Namespace("http://mlcommons.org/croissant/")
    problem = next(graph.subjects(rdflib.RDF.type, cr.TaskProblem))
    kinds = {
        "output": cr.OutputSpec,
        "implementation": cr.ImplementationSpec,
        "evaluation": cr.EvaluationSpec,
    }
    right = [
        (graph.value(problem, cr[name]), rdflib.RDF.type, kind) in graph
        for name, kind in kinds.items()
    ]
    schema = graph.value(graph.value(problem, cr.output), cr.schema)
    right.append((schema, rdflib.RDF.type, cr.RecordSet) in graph)
    fields = len(list(graph.objects(schema, cr.field)))
    asked = "rules of Croissant Tasks that are kept, and fields of the answer"
    measured, kept = f"{sum(right)}, {fields}", all(right) and fields >= 10
    return Check(asked, "4, at least 10", measured, kept)
