"""Croissant 1.1 documents: context, files, record sets and fields, with RAI 1.0 properties.

Source: https://docs.mlcommons.org/croissant/docs/croissant-spec-1.1.html and
croissant-rai-spec.html. mlcroissant 1.1.1 validates them.
"""

import importlib.metadata
from collections.abc import Iterable, Mapping, Sequence
from datetime import UTC, datetime
from typing import Any, Final

import polars as pl

from solver.instrument.files import sha256
from solver.instrument.units import unit_of
from vbaa_bench.dataset.document import read_json
from vbaa_bench.dataset.fingerprint import others_digest
from vbaa_bench.exports.card import DATA_LICENCE_URL, SUMMARY
from vbaa_bench.exports.columns import VECTORS, description
from vbaa_bench.exports.source import Source
from vbaa_bench.scene.shipped import frozen_frames, shipped_suites

Node = dict[str, Any]

# Appendix 1 of the specification, in the form that mlcroissant calls standard.
CONTEXT: Final[Node] = {
    "@language": "en",
    "@vocab": "https://schema.org/",
    "sc": "https://schema.org/",
    "cr": "http://mlcommons.org/croissant/",
    "rai": "http://mlcommons.org/croissant/RAI/",
    "dct": "http://purl.org/dc/terms/",
    "conformsTo": "dct:conformsTo",
    "data": {"@id": "cr:data", "@type": "@json"},
    "dataType": {"@id": "cr:dataType", "@type": "@vocab"},
    "examples": {"@id": "cr:examples", "@type": "@json"},
    "description": {"@container": "@language"},
    "name": {"@container": "@language"},
    **{
        name: f"cr:{name}"
        for name in (
            *("arrayShape", "citeAs", "column", "containedIn", "equivalentProperty", "extract"),
            *("field", "fileObject", "fileProperty", "fileSet", "format", "includes", "isArray"),
            *("isLiveDataset", "jsonPath", "key", "md5", "parentField", "path", "recordSet"),
            *("references", "regex", "repeated", "replace", "samplingRate", "separator", "source"),
            *("subField", "transform"),
        )
    },
}
TYPES: Final = {
    pl.String(): "sc:Text",
    pl.Float64(): "cr:Float64",
    pl.Int64(): "cr:Int64",
    pl.Boolean(): "sc:Boolean",
}

BIBTEX: Final = (
    "@misc{{vbaa_bench, title={{VBAA-Bench: a physically rendered benchmark for vision-based "
    "active antennas}}, author={{{{The VBAA-Bench authors}}}}, version={{{version}}}}}"
)

RAI: Final = {
    "rai:dataCollection": (
        "Synthetic. The equilibrium of a flexible beam that is pushed against an object is "
        "computed (planar elastica, or a Kirchhoff rod in space); meshes of the beam, the "
        "object and the laboratory are rendered; a model of an image sensor adds noise and "
        "quantises. Every value of the truth is the input or the result of this computation."
    ),
    "rai:dataCollectionType": ["Software Collection"],
    "rai:dataCollectionMissingData": (
        "A value that does not exist is null, such as the contact distance of a beam that "
        "touches nothing. A frame that could not be computed is not in the tables; "
        "failures.json of its shard states the reason."
    ),
    "rai:dataPreprocessingProtocol": ["None: images are stored as the sensor model delivers them."],
    "rai:dataAnnotationProtocol": ["No annotator: labels are computed before the image."],
    "rai:machineAnnotationTools": ["VBAA-Bench", "Mitsuba 3"],
    "rai:dataLimitations": [
        "Images are rendered, not photographed. Materials, lamps and the sensor are models; a "
        "method that is trained on them alone has not been shown to work with a real camera.",
        "A scene has the rig, beams, objects and lights that it states. Conclusions hold for these "
        "ranges, which truth/manifest.json (rigs/*/truth_manifest.json in exports) lists.",
        "Where a scene violates an assumption that no image shows, such as friction, the stated "
        "sigma of a method cannot include the resulting error.",
    ],
    "rai:dataBiases": [
        "Pushes follow the grid or the distributions of the scene, not their frequency in use.",
    ],
    "rai:dataUseCases": [
        "Comparison of methods that estimate contact distance, force, plane of bending and "
        "stiffness from an image of a bent beam, and training of such methods.",
        "Not suitable: safety limits of a real machine without measurements on that machine.",
    ],
    "rai:personalSensitiveInformation": ["None: the images show no persons."],
    "rai:dataSocialImpact": "None known: laboratory objects only.",
    "rai:dataReleaseMaintenancePlan": (
        "A dataset does not change: it is identified by its scene, seed, code and package "
        "versions (truth/identity.json), from which the same bytes can be generated again."
    ),
}


def document(source: Source, files: Sequence[Node], record_sets: Sequence[Node]) -> Node:
    """Make the document of a dataset from its files and record sets."""
    # The day on which the last rig was completed: a dataset has no other date.
    completed = max(rig.layout.hashes.stat().st_mtime for rig in source.rigs.values())
    version = importlib.metadata.version("vbaa-bench")
    return {
        "@context": CONTEXT,
        "@type": "sc:Dataset",
        "conformsTo": [
            "http://mlcommons.org/croissant/1.1",
            "http://mlcommons.org/croissant/RAI/1.0",
        ],
        "name": source.title,
        "description": " ".join(SUMMARY.split()),
        "license": DATA_LICENCE_URL,
        "creator": {"@type": "sc:Organization", "name": "The VBAA-Bench authors"},
        "datePublished": datetime.fromtimestamp(completed, UTC).date().isoformat(),
        "version": version,
        # The digest that `vbaa-bench verify DATASET --against` compares.
        "identifier": f"sha256:{source.digest}",
        "keywords": ["robotics", "tactile sensing", "vision-based active antenna", "synthetic"],
        "citeAs": BIBTEX.format(version=version),
        **_suites(others_digest(source.root)),
        **RAI,
        "distribution": list(files),
        "recordSet": [_splits(source), *record_sets],
    }


def _suites(others: str) -> Node:
    """List the suites whose frozen frames have the rig and the readings of a dataset."""
    nodes = []
    for path in shipped_suites():
        frozen = frozen_frames(path)
        datasets = read_json(frozen)["datasets"] if frozen.is_file() else {}
        nodes += [
            {
                "@type": "sc:CreativeWork",
                "name": f"VBAA-Bench suite {path.stem}, {name}",
                "version": path.stem,
                "identifier": f"sha256:{sha256(path)}",
            }
            for name, entry in datasets.items()
            if entry["others"] == others
        ]
    return {"isPartOf": nodes} if nodes else {}


def file_object(name: str, media_type: str, sha256: str) -> Node:
    """Describe one file by its path, relative to the document."""
    return {
        "@type": "cr:FileObject",
        "@id": name,
        "name": name,
        "contentUrl": name,
        "encodingFormat": media_type,
        "sha256": sha256,
    }


def file_set(name: str, media_type: str, includes: str, text: str) -> Node:
    """Describe all files that match a pattern, relative to the document."""
    return {
        "@type": "cr:FileSet",
        "@id": name,
        "name": name,
        "description": text,
        "encodingFormat": media_type,
        "includes": includes,
    }


def record_set(name: str, text: str, fields: Iterable[Node], key: str) -> Node:
    """Describe records; `key` is the field that identifies one."""
    return {
        "@type": "cr:RecordSet",
        "@id": name,
        "name": name,
        "description": text,
        "key": {"@id": f"{name}/{key}"},
        "field": list(fields),
    }


def column_field(records: str, name: str, dtype: pl.DataType, files: str) -> Node:
    """Describe a column by the data dictionary: its meaning, unit, frame, and when it is null."""
    shape = "3" if name in VECTORS else "-1"
    array = {"isArray": True, "arrayShape": shape} if isinstance(dtype, pl.List) else {}
    inner = pl.Float64() if array else dtype
    return field(records, name, meaning(name), TYPES[inner], extract(files, column=name)) | array


def field(records: str, name: str, text: str, data_type: str, source: Node) -> Node:
    """Describe a field of a record set."""
    return {
        "@type": "cr:Field",
        "@id": f"{records}/{name}",
        "name": name,
        "description": text,
        "dataType": data_type,
        "source": source,
    }


def extract(files: str, **selection: str) -> Node:
    """Select what a field is in the files of a set: a column or a property of the file."""
    return {"fileSet": {"@id": files}, "extract": selection}


def meaning(name: str) -> str:
    """Describe a column in one line."""
    column = description(name)
    parts = [column.meaning or name, f"[{unit_of(name).text}]" if unit_of(name).text else ""]
    parts += [f"(frame: {column.frame})" if column.frame else ""]
    parts += [f"(null: {column.null})" if column.null else ""]
    return " ".join(filter(None, parts))


def references(node: Node, target: Mapping[str, Any]) -> Node:
    """State that the values of a field are those of another field or column."""
    return {**node, "references": target}


def _splits(source: Source) -> Node:
    """List the splits, with the terms of the Croissant for the usual ones."""
    urls = {"train": "cr:TrainingSplit", "val": "cr:ValidationSplit", "test": "cr:TestSplit"}
    names = {"name": "the name of the split", "url": "its definition"}
    fields = [
        {"@type": "cr:Field", "@id": f"splits/{name}", "name": name, "description": text}
        | {"dataType": "sc:Text" if name == "name" else "sc:URL"}
        for name, text in names.items()
    ]
    rows = [{"splits/name": name, "splits/url": urls.get(name, "")} for name in source.splits]
    return {
        "@type": "cr:RecordSet",
        "@id": "splits",
        "name": "splits",
        "description": "Splits: each push, or each rig, is in one of them.",
        "dataType": "cr:Split",
        "key": {"@id": "splits/name"},
        "field": fields,
        "data": rows,
    }
