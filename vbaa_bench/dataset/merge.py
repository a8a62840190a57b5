"""Merge parts of a dataset or a collection, which were generated in different folders, into one."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from solver.instrument.errors import InputError
from solver.instrument.files import write_bytes
from solver.instrument.hashes import HASHES, hashes_bytes, parse_hashes
from vbaa_bench.dataset.collection import CollectionLayout, is_collection
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.dataset.manifest import read_json
from vbaa_bench.dataset.readers import check_complete, copy_tree


def merge(parts: Sequence[Path], out: Path) -> None:
    """Copy complete parts of one dataset, or rigs of one collection, into the new folder `out`.

    Every file is compared with its hash. Raises InputError if the parts do not belong together, are
    damaged or incomplete, or if `out` is not empty or cannot be written.
    """
    try:
        if out.exists() and any(out.iterdir()):
            raise InputError(f"{out}: is not empty; choose another folder")
        if all(map(is_collection, parts)):
            _merge_collections([CollectionLayout(part) for part in parts], CollectionLayout(out))
        else:
            _merge_datasets([Layout(part) for part in parts], Layout(out))
    except OSError as error:
        raise InputError(f"{out}: cannot be written ({error.strerror or error})") from error


def _merge_datasets(parts: Sequence[Layout], out: Layout) -> None:
    for part in parts:
        check_complete(part)
    first = parts[0]
    for part in parts[1:]:
        for path, other in ((first.identity, part.identity), (first.manifest, part.manifest)):
            if path.read_bytes() != other.read_bytes():
                raise InputError(f"{part.root}: is no part of the dataset {first.root}")
    for tree in ("truth", "observations"):  # the observations' hashes complete the dataset
        tables = [_table(part.root / tree) for part in parts]
        merged: dict[str, str] = {}
        for part, table in zip(parts, tables, strict=True):
            for name, digest in table.items():
                if merged.setdefault(name, digest) != digest:
                    raise InputError(f"{part.root / tree / name}: differs from that of other parts")
            copy_tree(part.root / tree, out.root / tree)
        write_bytes(out.root / tree / HASHES, hashes_bytes(merged))


def _table(tree: Path) -> Mapping[str, str]:
    table = parse_hashes((tree / HASHES).read_bytes())
    if table is None:
        raise InputError(f"{tree / HASHES}: is not what was generated")
    return table


def _merge_collections(parts: Sequence[CollectionLayout], out: CollectionLayout) -> None:
    out.root.mkdir(parents=True, exist_ok=True)
    scene = read_json(parts[0].scene)
    rows: dict[int, dict[str, str | None]] = {}
    for part in parts:
        if read_json(part.scene) != scene:
            raise InputError(f"{part.root}: is no part of the collection {parts[0].root}")
        rows |= part.read_rows()
        for number, layout in part.rigs().items():
            if not out.rig(number).hashes.is_file():
                _merge_datasets([layout], out.rig(number))
    out.write_rows(rows)
    out.write_scene(scene)
