"""Croissant metadata of datasets: of the canonical files, and of a Hugging Face export.

DIR/croissant.json        files with sha256, record sets, splits, RAI properties
DIR/croissant_task.json   the benchmark: problem, form of the answer, rules, evaluation
"""

import json
import mimetypes
from collections.abc import Iterator
from pathlib import Path, PurePath
from typing import Final

import polars as pl

from solver.instrument.errors import DamageError, InputError
from solver.instrument.files import sha256, write_text
from solver.instrument.hashes import HASHES, read_hashes
from vbaa_bench.dataset.dataset_columns import READINGS
from vbaa_bench.exports.columns import PLACE
from vbaa_bench.exports.croissant_document import (
    Node,
    column_field,
    document,
    extract,
    field,
    file_object,
    file_set,
    meaning,
    record_set,
    references,
)
from vbaa_bench.exports.croissant_task import task
from vbaa_bench.exports.source import Source, open_source

DOCUMENT: Final = "croissant.json"
_TASK: Final = "croissant_task.json"
_RIG_FOLDER: Final = {"transform": {"regex": "(rig_[0-9]+)/"}}
_PARQUET: Final = "application/x-parquet"
_BYTES: Final = "application/octet-stream"


def write_croissant(root: Path) -> Path:
    """Describe a dataset or a collection in croissant.json in its own folder; return the path.

    Paths in it are relative to this folder, and sha256 are those that the dataset recorded. Raises
    InputError if the dataset is incomplete or damaged, or the file cannot be written.
    """
    source = open_source(root, centrelines=True)
    try:
        _write(root, document(source, _canonical_files(source), _canonical_records(source)))
        errors = list(document_errors(root, source))
    except OSError as error:
        raise InputError(f"{root / DOCUMENT}: cannot be written ({error.strerror})") from error
    if errors:
        raise DamageError(f"{root / DOCUMENT}: does not fit the files: {'; '.join(errors[:10])}")
    return root / DOCUMENT


def document_errors(folder: Path, source: Source) -> Iterator[str]:
    """Compare a document with the files beside it, and describe each error. Raises OSError."""
    content = json.loads((folder / DOCUMENT).read_bytes())
    for node in content["distribution"]:
        if node["@type"] == "cr:FileObject":
            if sha256(folder / node["contentUrl"]) != node["sha256"]:
                yield f"the sha256 of {node['contentUrl']} differs"
        else:
            count = sum(1 for _ in folder.glob(node["includes"]))
            if not count or (node["@id"] == "images-files" and count != source.frames):
                yield f"{node['includes']} matches {count} files, of {source.frames} frames"
    splits = [row["splits/name"] for row in content["recordSet"][0]["data"]]
    if splits != list(source.splits):
        yield f"its splits are {splits}, those of the dataset {list(source.splits)}"


def write_exported(folder: Path, source: Source) -> None:
    """Describe a Hugging Face export in its folder. Raises OSError."""
    paths = sorted(path.relative_to(folder) for path in (folder / "data").glob("*.parquet"))
    paths += sorted(
        path.relative_to(folder) for path in (folder / "rigs").rglob("*") if path.is_file()
    )
    files = [_file(path, sha256(folder / path)) for path in paths]
    files.append(file_set("frames-files", _PARQUET, "data/*.parquet", "One row per frame."))
    image = field(
        "frames",
        "image",
        "gray image, PNG of 8 or 16 bits",
        "sc:ImageObject",
        {**extract("frames-files", column="image"), "transform": {"jsonPath": "bytes"}},
    )
    columns = [
        column_field("frames", name, dtype, "frames-files")
        for name, dtype in source.schema.exported.items()
    ]
    fields = [image, *map(_with_split, columns)]
    text = "Images, readings and labels; a method may use the image and the readings."
    _write(folder, document(source, files, [record_set("frames", text, fields, "frame_id")]))


def _write(folder: Path, content: Node) -> None:
    write_text(folder / DOCUMENT, json.dumps(content, indent=2) + "\n")
    write_text(folder / _TASK, json.dumps(task(DOCUMENT), indent=2) + "\n")


def _with_split(node: Node) -> Node:
    """Let the field of the split refer to the list of splits."""
    target = {"field": {"@id": "splits/name"}}
    return references(node, target) if node["name"] == "split" else node


def _file(path: PurePath, digest: str) -> Node:
    is_parquet = path.suffix == ".parquet"
    media_type = _PARQUET if is_parquet else mimetypes.guess_type(path.name)[0] or _BYTES
    return file_object(path.as_posix(), media_type, digest)


def _canonical_files(source: Source) -> list[Node]:
    """List single files and the tables of hashes with their sha256, and the files of shards."""
    nodes = []
    for rig in source.rigs.values():
        for tree in rig.layout.trees:
            folder = tree.relative_to(source.root)
            hashes = {**(read_hashes(tree) or {}), HASHES: sha256(tree / HASHES)}
            nodes += [
                _file(folder / name, digest)
                for name, digest in sorted(hashes.items())
                if not name.startswith("shard_")
            ]
    first = "rig_*/" if source.collection else ""
    note = f"{HASHES} of each shard lists their sha256, that of each tree the sha256 of these."
    sets = {
        "readings": ("text/csv", "observations/shard_*/metadata.csv", "Readings of the frames."),
        "images": ("image/png", "observations/shard_*/*.png", "Images of the frames."),
        "truth": (_PARQUET, "truth/shard_*/truth.parquet", "Labels of the frames."),
    }
    if any(rig.stated("layers") for rig in source.rigs.values()):
        sets["layers"] = ("image/x-exr", "truth/shard_*/*.exr", "Labels of the pixels.")
    nodes += [
        file_set(f"{name}-files", media_type, f"{first}{pattern}", f"{text} {note}")
        for name, (media_type, pattern, text) in sets.items()
    ]
    return nodes


def _canonical_records(source: Source) -> list[Node]:
    """Describe the frames, readings joined with labels by frame_id, and the images."""
    fields, types = [], source.schema.exported
    stated = {name for name in types if name in READINGS}
    if not any(rig.stated("splits") for rig in source.rigs.values()):
        stated.discard("split")
    if source.collection:
        folder = {**extract("readings-files", fileProperty="fullpath"), **_RIG_FOLDER}
        fields.append(field("frames", "rig", meaning("rig"), "sc:Text", folder))
    for name, dtype in types.items():
        if name in stated:
            node = column_field("frames", name, dtype, "readings-files")
            if name == "frame_id":
                node = references(node, extract("truth-files", column=name))
            fields.append(_with_split(node))
        elif name not in PLACE:
            fields.append(column_field("frames", name, dtype, "truth-files"))
    file_name = column_field("frames", "file_name", pl.String(), "readings-files")
    text = "Readings, which a method may use, joined with the labels by frame_id."
    frames = record_set("frames", text, [file_name, *fields], "frame_id")
    image = "gray image of 8 or 16 bits; mlcroissant converts it to 8 bits in three channels"
    images = [
        field(
            "images",
            "file_name",
            "name of the file, <frame_id>.png",
            "sc:Text",
            extract("images-files", fileProperty="filename"),
        ),
        field(
            "images",
            "image",
            image,
            "sc:ImageObject",
            extract("images-files", fileProperty="content"),
        ),
    ]
    return [frames, record_set("images", "Images of the frames.", images, "file_name")]
