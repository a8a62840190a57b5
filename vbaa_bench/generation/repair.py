"""Repair of a dataset or collection: what can be rendered again is, damaged results are removed."""

import shutil
from collections.abc import Callable, Collection
from pathlib import Path
from typing import Final

from solver.instrument.errors import InputError
from solver.instrument.hashes import HASHES
from vbaa_bench.dataset.collection import CollectionLayout, is_collection
from vbaa_bench.dataset.document import read_json
from vbaa_bench.dataset.faults import SURPLUS, Fault, read_hash_table
from vbaa_bench.dataset.format_version import migrated_identity, migrated_manifest
from vbaa_bench.dataset.layout import Layout, shard_numbers
from vbaa_bench.dataset.recorded import write_results
from vbaa_bench.dataset.result_faults import RESULTS
from vbaa_bench.generation.generate import Part, Progress, generate
from vbaa_bench.generation.generate_collection import failed, generate_collection
from vbaa_bench.render.variant import choose
from vbaa_bench.scene.frames import Frames
from vbaa_bench.scene.load import SceneFile, check_scene, recorded_scene

_RESULTS: Final = {results.folder for results in RESULTS}


def repair(
    root: Path,
    faults: Collection[Fault],
    scene: SceneFile | None,
    workers: int,
    progress: Progress,
    remark: Callable[[str], None],
) -> None:
    """Render damaged files of a dataset or collection again, and remove files that do not belong.

    The scene is that of the dataset's own records, with its copies of the files that the scene
    names, unless `scene` is stated. Of the results, damaged and surplus files are removed: they
    must be computed again. Raises InputError if the dataset cannot be generated, for example
    because it is of another version of the code.
    """
    roots = [root]
    if is_collection(root):
        layout = CollectionLayout(root)
        numbers = _damaged_rigs(layout, faults)
        rigs = [layout.rig(number) for number in sorted({*layout.folders(), *numbers})]
        roots += [rig.root for rig in rigs]
        if numbers:
            file = scene or check_scene(layout.read_scene()).with_files_in(layout.files)
            variant = choose(_variant(rigs))
            results = generate_collection(file, root, variant, workers, progress, numbers)
            for sentence in failed(results):
                remark(sentence)
    elif any(_is_rendered(root, fault) for fault in faults):
        layout_of_one = Layout(root)
        file = scene or _scene_of_dataset(layout_of_one)
        part = _part(layout_of_one, file)
        variant = choose(_variant([layout_of_one]))
        generate(file, root, variant, workers, progress, remark=remark, part=part)
    for folder in roots:
        _remove_leftovers(Layout(folder))
        _remove_results(folder, faults)


def _remove_leftovers(layout: Layout) -> None:
    """Remove what interrupted commands left, and folders of shards that are empty."""
    for path in layout.root.glob(".shard_*.part"):
        shutil.rmtree(path)
    for tree in layout.trees:
        for path in tree.glob("shard_*"):
            if path.is_dir() and not any(path.iterdir()):
                path.rmdir()


def _is_rendered(root: Path, fault: Fault) -> bool:
    parts = fault.path.relative_to(root).parts if fault.path.is_relative_to(root) else ()
    return bool(parts) and parts[0] not in _RESULTS


def _damaged_rigs(layout: CollectionLayout, faults: Collection[Fault]) -> list[int]:
    """List the numbers of rigs to be rendered again; all if a table of the collection is damaged.

    The folder of a rig that is impossible is left alone.
    """
    numbers = set[int]()
    for fault in faults:
        folder, *rest = fault.path.relative_to(layout.root).parts
        if folder.startswith("rig_"):
            if (rest and rest[0] not in _RESULTS) or (not rest and fault.kind != SURPLUS):
                numbers.add(int(folder.removeprefix("rig_")))
        elif folder not in _RESULTS:
            numbers |= set(layout.folders())
    return sorted(numbers)


def _scene_of_dataset(layout: Layout) -> SceneFile:
    """Return the scene that identity.json or else manifest.json records. Raises InputError."""
    title, values, source = layout.root.name, None, layout.manifest
    for path, migrated in (
        (layout.manifest, migrated_manifest),
        (layout.identity, migrated_identity),
    ):
        try:
            document = migrated(path, read_json(path))
            values, source = document["scene"], path
            title = values.get("title", title)
        except (InputError, KeyError, AttributeError):
            continue
        if "subset" in document:
            raise InputError(
                f"{layout.root}: is a subset of another dataset, which cannot be rendered again; "
                "make it again with vbaa-bench subset"
            )
    if values is None:
        raise InputError(f"{layout.root}: both records of its scene are damaged; state --scene")
    return recorded_scene({**values, "title": title}, source, layout.files)


def _variant(layouts: Collection[Layout]) -> str | None:
    """Return Mitsuba's variant that made the first dataset with a readable record; else None."""
    for layout in layouts:
        try:
            return str(read_json(layout.identity)["made_with"]["variant"])
        except (InputError, KeyError, TypeError):
            pass
        try:
            return str(read_json(layout.manifest)["variant"])
        except (InputError, KeyError):
            pass
    return None


def _part(layout: Layout, file: SceneFile) -> Part | None:
    """Return which part of its scene's shards a dataset has, None if all.

    Raises InputError if no table of hashes lists them, or if they are no part.
    """
    tables = [table for tree in layout.trees if (table := read_hash_table(tree).hashes) is not None]
    if not tables:
        raise InputError(
            f"{layout.root}: is incomplete; run the command that generates it again to finish it"
        )
    numbers = shard_numbers(name for table in tables for name in table)
    total = Frames(file.scene).shards
    if numbers == list(range(total)):
        return None
    first = numbers[0] if numbers else 0
    step = numbers[1] - first if len(numbers) > 1 else total
    if numbers != list(range(first, total, step)):
        raise InputError(
            f"{layout.root}: has shards {numbers[:5]}, which are no part of {total} shards; state "
            "the scene from which it was generated by --scene"
        )
    return Part(first + 1, step)


def _remove_results(root: Path, faults: Collection[Fault]) -> None:
    """Remove damaged and surplus results, and the records of missing ones.

    Where a table of hashes is itself damaged, nothing is removed: commands refuse its files until
    they are computed again.
    """
    for folder in sorted(root / name for name in _RESULTS):
        names = {fault.path.name for fault in faults if fault.path.parent == folder}
        if names and HASHES not in names:
            write_results(folder, {}, [name for name in names if not (folder / name).is_dir()])
