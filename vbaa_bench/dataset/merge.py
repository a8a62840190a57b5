"""Merge parts of a dataset or a collection, which were generated in different folders, into one."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

from solver.instrument.errors import DamageError, InputError
from solver.instrument.files import write_bytes
from solver.instrument.hashes import MEND, digest, read_bytes, read_hashes
from vbaa_bench.dataset.collection import CollectionLayout, is_collection
from vbaa_bench.dataset.copies import complete_table, copy_tree, new_folder, seal_copy
from vbaa_bench.dataset.document import listing, read_json
from vbaa_bench.dataset.format_version import SCHEMA, version_of
from vbaa_bench.dataset.layout import Layout, shard_name, shard_numbers
from vbaa_bench.dataset.manifest import manifest_bytes
from vbaa_bench.dataset.readers import check_complete
from vbaa_bench.scene.frames import Frames
from vbaa_bench.scene.load import recorded_scene

# Keys of a manifest in which parts of one dataset may differ: their numbers of frames.
_COUNTS: Final = ("frames", "failed_frames")


def merge(parts: Sequence[Path], out: Path) -> None:
    """Copy all parts of one dataset, or rigs of one collection, into the new folder `out`.

    Every file is compared with its hash when it is read, and again after it was written. Raises
    InputError if the parts do not belong together, overlap, lack a shard, are damaged or
    incomplete, or if `out` is not empty or cannot be written.
    """
    with new_folder(out):
        if all(map(is_collection, parts)):
            _merge_collections([CollectionLayout(part) for part in parts], CollectionLayout(out))
        else:
            _merge_parts([Layout(part) for part in parts], Layout(out))


def _merge_parts(parts: Sequence[Layout], out: Layout) -> None:
    """Merge parts of a dataset that have all its shards, each once."""
    for part in parts:
        check_complete(part)
        for path in (part.identity, part.manifest):
            version = version_of(path, read_json(path))
            if version != SCHEMA:
                raise InputError(
                    f"{path}: has version {version} of the format, only parts of version {SCHEMA} "
                    "can be merged; generate them again"
                )
    _check_same_dataset(parts)
    _check_shards(parts)
    _copy(parts, out)


def _check_same_dataset(parts: Sequence[Layout]) -> None:
    """Raise InputError unless all parts have one identity, and one manifest except for counts."""
    first = parts[0]

    def manifest(part: Layout) -> dict[str, object]:
        return {k: value for k, value in read_json(part.manifest).items() if k not in _COUNTS}

    for part in parts:
        if "subset" in read_json(part.identity):
            raise InputError(f"{part.root}: is a subset, allowed are parts made by --part")
        same_identity = read_json(first.identity) == read_json(part.identity)
        if not same_identity or manifest(first) != manifest(part):
            raise InputError(f"{part.root}: is no part of the dataset {first.root}")


def _check_shards(parts: Sequence[Layout]) -> None:
    """Raise InputError unless each shard of the scene is in one part."""
    owners: dict[int, Layout] = {}
    for part in parts:
        for number in shard_numbers(complete_table(part.truth)):
            owner = owners.setdefault(number, part)
            if owner is not part:
                raise InputError(
                    f"{part.root}: overlaps {owner.root}, both have {shard_name(number)}; merge "
                    "each part once"
                )
    manifest = parts[0].manifest
    scene = recorded_scene(read_json(manifest)["scene"], manifest, parts[0].files).scene
    numbers = range(Frames(scene).shards)
    missing = [shard_name(number) for number in numbers if number not in owners]
    if missing:
        raise InputError(f"{parts[0].root}: the parts lack {listing(missing)}; merge all parts")


def _copy(parts: Sequence[Layout], out: Layout) -> None:
    """Copy complete datasets or parts into one, verify it, and complete it."""
    tables: dict[str, dict[str, str]] = {}
    for tree in ("truth", "observations"):
        tables[tree] = {}
        for part in parts:
            for name, recorded in (read_hashes(part.root / tree) or {}).items():
                is_manifest = part.root / tree / name == part.manifest
                if tables[tree].setdefault(name, recorded) != recorded and not is_manifest:
                    raise InputError(f"{part.root / tree / name}: differs from that of other parts")
            copy_tree(part.root / tree, out.root / tree)
    manifest = manifest_bytes(_manifest(parts))
    write_bytes(out.manifest, manifest)
    tables["truth"][out.manifest.name] = digest(manifest)
    seal_copy(out, tables)


def _manifest(parts: Sequence[Layout]) -> dict[str, Any]:
    """Return the manifest of the parts, with the sums of their counts."""
    documents = [read_json(part.manifest) for part in parts]
    counted = {key for key in _COUNTS if key in documents[0]}
    return documents[0] | {key: sum(one[key] for one in documents) for key in counted}


def _merge_collections(parts: Sequence[CollectionLayout], out: CollectionLayout) -> None:
    out.root.mkdir(parents=True, exist_ok=True)
    scene, files = parts[0].read_scene(), parts[0].read_files()
    rows: dict[int, dict[str, str | None]] = {}
    for part in parts:
        if part.read_scene() != scene or part.read_files() != files:
            raise InputError(f"{part.root}: is no part of the collection {parts[0].root}")
        rows |= part.read_rows()
        for number, layout in part.rigs().items():
            if out.rig(number).hashes.is_file():
                raise InputError(f"{part.root}: overlaps another part, both have rig {number}")
            _copy([layout], out.rig(number))
    out.write_rows(rows)
    for name, recorded in files.items():
        data = read_bytes(parts[0].files / name)
        if digest(data) != recorded:
            raise DamageError(f"{parts[0].files / name}: is not what was generated; {MEND}")
        (out.files / name).parent.mkdir(parents=True, exist_ok=True)
        write_bytes(out.files / name, data)
    out.write_scene(scene, files)
