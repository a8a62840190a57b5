"""Verification of a dataset or collection: everything that is wrong, by name, in one pass.

No file is trusted: contents are compared with the sha256 in the hashes.json of their folder, each
hashes.json with that of its tree, both trees with each other, and the two records of the truth.
"""

import contextlib
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import polars as pl

from solver.instrument.errors import InputError
from solver.instrument.files import read_regular
from solver.instrument.hashes import HASHES, checks_itself
from vbaa_bench.dataset.collection import CollectionLayout, is_collection
from vbaa_bench.dataset.document import read_json
from vbaa_bench.dataset.faults import (
    DAMAGED,
    FOREIGN,
    INCOMPLETE,
    SURPLUS,
    UNRECORDED,
    VERSION,
    Fault,
    HashTable,
    file_fault,
    folder_faults,
    missing,
    read_hash_table,
    surplus,
    unlisted_files,
)
from vbaa_bench.dataset.format_version import version_of
from vbaa_bench.dataset.layout import FAILURES, TRUTH_TABLE, Layout, shard_hashes, shard_numbers
from vbaa_bench.dataset.result_faults import result_faults
from vbaa_bench.dataset.tables import read_parquet


@dataclass
class Counts:
    """Numbers of what a verification has checked."""

    datasets: int = 0
    shards: int = 0
    frames: int = 0
    files: int = 0


def faults(
    root: Path, methods: Collection[str], counts: Counts, progress: Callable[[int, int], None]
) -> Iterator[Fault]:
    """Find everything that is wrong in a dataset or collection.

    `methods` are the names of the solver's methods, whose predictions must be recorded. `counts`
    is updated, and `progress(done, total)` called after each shard. Raises InputError if `root` is
    neither a dataset nor a collection.
    """
    if is_collection(root):
        layout = CollectionLayout(root)
        rigs = layout.folders()
    else:
        rigs = {0: Layout(root)}
        if not any(tree.is_dir() for tree in rigs[0].trees):
            raise InputError(f"{root}: is neither a dataset nor a collection")
    shards = {number: _shards(rig) for number, rig in rigs.items()}
    total = sum(map(len, shards.values()))

    def on_shard() -> None:
        counts.shards += 1
        progress(counts.shards, total)

    if is_collection(root):
        yield from _collection_faults(layout, rigs)
        yield from result_faults(root, methods)
    for number, rig in rigs.items():
        counts.datasets += 1
        yield from _dataset_faults(rig, shards[number], counts, on_shard)
        yield from result_faults(rig.root, methods)


def _collection_faults(layout: CollectionLayout, rigs: Collection[int]) -> Iterator[Fault]:
    """Compare the tables of a collection with its rigs."""
    table = read_hash_table(layout.root)
    if table.fault is not None:
        yield table.fault
    for path in (layout.scene, layout.table, *_files_of_scene(layout)):
        recorded = (table.hashes or {}).get(path.relative_to(layout.root).as_posix())
        fault = file_fault(path, recorded) if recorded else None
        if fault is not None:
            yield fault
        elif recorded is None and (table.hashes is not None or not path.is_file()):
            yield Fault(path, UNRECORDED, "is missing or has no recorded sha256")
    try:
        rows = layout.read_rows()
    except InputError:
        return
    for number in sorted(rows.keys() | set(rigs)):
        folder = layout.rig(number).root
        if number not in rows:
            yield Fault(folder, FOREIGN, "has no row in rigs.csv")
        elif rows[number].get("reason") and number in rigs:
            yield Fault(folder, SURPLUS, "is impossible according to rigs.csv")
        elif not rows[number].get("reason") and number not in rigs:
            yield Fault(folder, INCOMPLETE, "is missing, its row is in rigs.csv")


def _files_of_scene(layout: CollectionLayout) -> list[Path]:
    """List the copies of files that the scene of a collection names, or that are there."""
    paths = {path for path in layout.files.rglob("*") if not path.is_dir() or path.is_symlink()}
    with contextlib.suppress(InputError):  # reported with collection.json
        paths |= {layout.files / name for name in layout.read_files()}
    return sorted(paths)


def _shards(layout: Layout) -> list[int]:
    """List the numbers of all shards that exist or are listed in one of the trees."""
    names = set[str]()
    for tree in layout.trees:
        names |= (read_hash_table(tree).hashes or {}).keys()
        names |= {path.name for path in tree.iterdir()} if tree.is_dir() else set()
    return shard_numbers(names)


def _dataset_faults(
    layout: Layout, shards: list[int], counts: Counts, on_shard: Callable[[], None]
) -> Iterator[Fault]:
    records = _records(layout)
    yield from records.faults
    tables = {tree: read_hash_table(tree) for tree in layout.trees}
    for tree, table in tables.items():
        yield from _table_faults(layout, tree, table, records.version)
        for name, recorded in sorted((table.hashes or {}).items()):
            if not name.endswith(f"/{HASHES}"):
                counts.files += 1
                fault = file_fault(tree / name, recorded)
                if fault is not None:
                    yield fault
        yield from _surplus(layout, tree, table, shards)
    for number in shards:
        yield from _shard_faults(layout, number, tables, counts)
        on_shard()
    for path in sorted(layout.all_aside()):
        yield Fault(path, SURPLUS, "was left by an interrupted command")


def _table_faults(layout: Layout, tree: Path, table: HashTable, version: int) -> Iterator[Fault]:
    path = tree / HASHES
    if table.fault is not None and path == layout.hashes and not path.exists():
        yield Fault(path, INCOMPLETE, "is missing, so that the dataset is incomplete or damaged")
    elif table.fault is not None:
        yield table.fault
    elif version > 1 and not checks_itself(read_regular(path)):
        yield Fault(path, DAMAGED, "does not include its own sha256")
    for needed in (layout.identity, layout.manifest, layout.rig):
        if needed.parent == tree and table.hashes is not None and needed.name not in table.hashes:
            yield Fault(needed, UNRECORDED, "has no recorded sha256")


def _surplus(layout: Layout, tree: Path, table: HashTable, shards: list[int]) -> Iterator[Fault]:
    """Find files of a tree that its table does not list, outside of shards."""
    if table.hashes is None:
        return
    known = {tree / name for name in table.hashes} | {tree / HASHES}
    folders = {layout.shard(tree, number) for number in shards}
    yield from map(surplus, unlisted_files(tree, known, folders))


def _shard_faults(
    layout: Layout, number: int, tables: dict[Path, HashTable], counts: Counts
) -> Iterator[Fault]:
    """Compare the files of a shard with its hashes, and its frames in both trees."""
    whole = True
    for tree in layout.trees:
        folder, listed = layout.shard(tree, number), tables[tree].hashes
        recorded = (listed or {}).get(shard_hashes(number))
        if listed is not None and recorded is None:
            whole = False
            yield Fault(folder, FOREIGN, f"is not in {tree / HASHES}")
            continue
        if not folder.is_dir():
            whole = False
            yield missing(folder)
            continue
        table = read_hash_table(folder, recorded)
        counts.files += len(table.hashes or {})
        for fault in folder_faults(folder, table):
            whole = False
            yield fault
    if whole:
        yield from _frame_faults(layout, number, counts)


def _frame_faults(layout: Layout, number: int, counts: Counts) -> Iterator[Fault]:
    """Compare the names of a shard's frames in both trees; its files are intact."""
    folder = layout.shard(layout.truth, number)
    images = {path.stem for path in layout.shard(layout.observations, number).glob("*.png")}
    counts.frames += len(images)
    path = folder / TRUTH_TABLE
    try:
        table = read_parquet(path, read_regular(path), lambda name: name == "frame_id")
        frames = set(table["frame_id"])
    except (InputError, pl.exceptions.PolarsError):
        yield Fault(path, DAMAGED, "has no column frame_id")
        return
    failures = set(read_json(folder / FAILURES)) if (folder / FAILURES).is_file() else set()
    if frames != images or frames & failures:
        yield Fault(folder, FOREIGN, "has other frames than the shard in observations")


class _Records(NamedTuple):
    """Faults of identity.json and manifest.json, and the version that they state, at least 1."""

    faults: list[Fault]
    version: int


def _records(layout: Layout) -> _Records:
    """Compare the identity with the manifest. Bytes are compared with the hashes elsewhere."""
    record_faults, versions, documents = list[Fault](), [1], list[dict[str, Any]]()
    for path in (layout.identity, layout.manifest):
        if not path.is_file():
            continue
        try:
            document = read_json(path)
        except InputError:  # reported with the other files
            continue
        try:
            versions.append(version_of(path, document))
            documents.append(document)
        except InputError as error:
            record_faults.append(Fault(path, VERSION, str(error).removeprefix(f"{path}: ")))
    if len(documents) == 2:
        identity, manifest = documents
        scenes = [dict(one.get("scene") or {}) for one in documents]
        for scene in scenes:
            scene.pop("title", None)
        if scenes[0] != scenes[1]:
            record_faults.append(
                Fault(layout.manifest, FOREIGN, "has another scene than identity.json")
            )
        elif identity.get("schema", 1) != manifest.get("schema", 1):
            record_faults.append(
                Fault(layout.manifest, VERSION, "has another schema than identity.json")
            )
    return _Records(record_faults, max(versions))
