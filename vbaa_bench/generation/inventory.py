"""Inventory of a dataset: the files that its scene requires, and which of them are intact."""

import json
import shutil
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Self

from solver.instrument.files import read_regular
from solver.instrument.hashes import HASHES, parse_hashes
from vbaa_bench.dataset.faults import (
    Fault,
    HashTable,
    file_fault,
    folder_faults,
    name_faults,
    read_hash_table,
    unlisted_files,
)
from vbaa_bench.dataset.layout import FAILURES, FILES, METADATA, TRUTH_TABLE, Layout, shard_hashes
from vbaa_bench.scene.frames import FrameName
from vbaa_bench.scene.schema import Scene


def image_names(scene: Scene) -> tuple[str, ...]:
    """Name the images of board, beam at rest and ground of a scene, as in observations/."""
    return (
        *(f"calibration/view_{view:02d}.png" for view in range(scene.calibration.views)),
        *(f"rest/rest_{number:02d}.png" for number in range(scene.sensor.rest_images)),
        *(f"ground/ground_{number:02d}.png" for number in range(scene.sensor.ground_images)),
    )


@dataclass(frozen=True)
class Contents:
    """Contents of a complete dataset: single images, frames by shard, truth images or not.

    Images are named as in observations/, `files` of the scene as in truth/files/. A part of a
    dataset has some of its shards.
    """

    images: tuple[str, ...]
    shards: Mapping[int, tuple[FrameName, ...]]
    layers: bool
    files: tuple[str, ...] = ()

    @classmethod
    def of_scene(
        cls, scene: Scene, shards: Mapping[int, tuple[FrameName, ...]], files: Collection[str]
    ) -> Self:
        """Return the contents of a scene's dataset, with all or some of the scene's shards."""
        return cls(image_names(scene), shards, bool(scene.layers), tuple(files))

    def names(self, tree: str, number: int, failed: Collection[str] = ()) -> set[str]:
        """Name the files of a shard in one of the trees, except its hashes.json.

        Frames that `failed` have no files.
        """
        ids = {name.frame_id for name in self.shards[number]}.difference(failed)
        if tree == "observations":
            return {METADATA, *(f"{frame_id}.png" for frame_id in ids)}
        names = {TRUTH_TABLE, *(f"{frame_id}.exr" for frame_id in ids if self.layers)}
        return names | {FAILURES} if failed else names


@dataclass
class Inventory:
    """The sha256 of intact files, by tree and name, and a message for each damage.

    A shard that is intact in both trees is represented by its hashes.json alone, and has a number
    of `failed` frames.
    """

    whole: dict[str, dict[str, str]] = field(
        default_factory=lambda: {"observations": {}, "truth": {}}
    )
    damage: list[str] = field(default_factory=list)
    failed: dict[int, int] = field(default_factory=dict)


def take_inventory(layout: Layout, contents: Contents) -> Inventory:
    """Read every file of a dataset and compare it with the recorded hashes.

    The files of a shard are checked by its own hashes, single files by those of their tree. Files
    that an incomplete dataset does not have yet are no damage.
    """
    inventory = Inventory()
    recorded = {tree.name: _recorded(tree) for tree in layout.trees}
    singles = [(layout.observations, name) for name in contents.images]
    of_truth = [*(f"{FILES}/{name}" for name in contents.files)]
    of_truth += [path.name for path in (layout.metering, layout.manifest)]
    for tree, name in [*singles, *((layout.truth, name) for name in of_truth)]:
        table = recorded[tree.name]
        expected = (table or {}).get(name)
        fault = file_fault(tree / name, expected or "")
        if fault is None and expected:
            inventory.whole[tree.name][name] = expected
        elif fault is not None and table is not None:
            inventory.damage.append(str(fault))
    for number in contents.shards:
        name = shard_hashes(number)
        digests, faults, tables = dict[str, str](), list[Fault](), dict[str, HashTable]()
        for tree in layout.trees:
            recorded_digest = (recorded[tree.name] or {}).get(name)
            tables[tree.name] = read_hash_table(layout.shard(tree, number), recorded_digest)
            digests[tree.name] = tables[tree.name].digest
        failed = failed_frames(layout.shard(layout.truth, number), tables[layout.truth.name])
        for tree in layout.trees:
            folder, of_shard = layout.shard(tree, number), tables[tree.name]
            if failed is not None:
                faults += name_faults(folder, of_shard, contents.names(tree.name, number, failed))
            faults += folder_faults(folder, of_shard)
        if faults or failed is None:
            exists = any(layout.shard(tree, number).exists() for tree in layout.trees)
            if exists or recorded["observations"] is not None:
                inventory.damage += map(str, faults)
            continue
        inventory.failed[number] = len(failed)
        for tree_name, value in digests.items():
            inventory.whole[tree_name][name] = value
    return inventory


def failed_frames(folder: Path, table: HashTable) -> dict[str, str] | None:
    """Read the reasons, by frame id, why frames of a truth shard are missing; None if damaged.

    `table` is the shard's hashes.json.
    """
    if FAILURES not in (table.hashes or {}):
        return {}
    try:
        reasons = json.loads(read_regular(folder / FAILURES))
    except (OSError, ValueError, RecursionError):
        return None
    return reasons if isinstance(reasons, dict) else None


def open_for_growth(layout: Layout, contents: Contents) -> None:
    """Remove what a larger dataset replaces: the trees' hashes and a shard that was not full.

    If no shard is left, the metering is measured again, because more frames may contribute to it.
    """
    for tree in (layout.observations, layout.truth):
        (tree / HASHES).unlink(missing_ok=True)
    for number in contents.shards:
        truth = layout.shard(layout.truth, number)
        failed = failed_frames(truth, read_hash_table(truth)) or {}
        for tree in layout.trees:
            folder, names = layout.shard(tree, number), contents.names(tree.name, number, failed)
            if (table := _recorded(folder)) and table.keys() != names:
                shutil.rmtree(folder)
    if not any(layout.shard(layout.truth, number).exists() for number in contents.shards):
        layout.metering.unlink(missing_ok=True)


def surplus(layout: Layout, contents: Contents) -> Iterator[Path]:
    """Find files in the trees that are neither contents nor in shards; no link is followed."""
    known = {layout.rig, *(layout.observations / name for name in contents.images)}
    known |= {layout.files / name for name in contents.files}
    known |= {layout.identity, layout.metering, layout.manifest}
    known |= {tree / HASHES for tree in layout.trees}
    shards = {layout.shard(tree, number) for tree in layout.trees for number in contents.shards}
    for tree in layout.trees:
        yield from unlisted_files(tree, known, shards)


def _recorded(tree: Path) -> dict[str, str] | None:
    """Read the table of a tree's hashes.json: None if it is missing, empty if it is damaged."""
    try:
        return parse_hashes(read_regular(tree / HASHES)) or {}
    except OSError:
        return None
