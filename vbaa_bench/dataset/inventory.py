"""Inventory of a dataset: find the intact, damaged and surplus files."""

import contextlib
import json
import os
import shutil
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from solver.instrument.errors import DamageError
from solver.instrument.files import sha256
from solver.instrument.hashes import HASHES, digest, parse_hashes
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.dataset.writer import FAILURES


@dataclass(frozen=True)
class Contents:
    """Contents of a complete dataset: single images, frame ids by shard, truth images or not.

    Images are named as in observations/. A part of a dataset has some of its shards.
    """

    images: tuple[str, ...]
    shards: Mapping[int, tuple[str, ...]]
    layers: bool

    def names(self, tree: str, number: int, failed: Collection[str] = ()) -> set[str]:
        """Name the files of a shard in one of the trees, except its hashes.json.

        Frames that `failed` have no files.
        """
        ids = set(self.shards[number]).difference(failed)
        if tree == "observations":
            return {"metadata.csv", *(f"{frame_id}.png" for frame_id in ids)}
        names = {"truth.parquet", *(f"{frame_id}.exr" for frame_id in ids if self.layers)}
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
    for tree, name in [*singles, (layout.truth, layout.manifest.name)]:
        table = recorded[tree.name]
        try:
            inventory.whole[tree.name][name] = _file(tree / name, (table or {}).get(name))
        except DamageError as error:
            if table is not None:
                inventory.damage.append(str(error))
    for number in contents.shards:
        name = f"{layout.shard(layout.truth, number).name}/{HASHES}"
        try:
            failed = read_failures(layout, number)
            digests = {
                tree.name: _shard(
                    layout.shard(tree, number),
                    contents.names(tree.name, number, failed),
                    (recorded[tree.name] or {}).get(name),
                )
                for tree in layout.trees
            }
        except DamageError as error:
            exists = any(layout.shard(tree, number).exists() for tree in layout.trees)
            if exists or recorded["observations"] is not None:
                inventory.damage.append(str(error))
            continue
        inventory.failed[number] = len(failed)
        for tree_name, value in digests.items():
            inventory.whole[tree_name][name] = value
    return inventory


def read_failures(layout: Layout, number: int) -> dict[str, str]:
    """Read the reasons, by frame id, why frames of a shard are missing. Raises DamageError."""
    path = layout.shard(layout.truth, number) / FAILURES
    try:
        table = json.loads(path.read_bytes())
    except FileNotFoundError:
        return {}
    except OSError as error:
        raise DamageError(f"{path}: cannot be read ({error.strerror})") from error
    except (ValueError, RecursionError):
        table = None
    if not isinstance(table, dict) or not all(isinstance(value, str) for value in table.values()):
        raise DamageError(f"{path}: is not what was generated")
    return table


def open_for_growth(layout: Layout, contents: Contents) -> None:
    """Remove what a larger dataset replaces: the trees' hashes and a shard that was not full."""
    for tree in (layout.observations, layout.truth):
        (tree / HASHES).unlink(missing_ok=True)
    for number in contents.shards:
        failed = dict[str, str]()
        with contextlib.suppress(DamageError):  # a damaged shard is generated again anyway
            failed = read_failures(layout, number)
        for tree in layout.trees:
            folder, names = layout.shard(tree, number), contents.names(tree.name, number, failed)
            if (table := _recorded(folder)) and table.keys() != names:
                shutil.rmtree(folder)


def surplus(layout: Layout, contents: Contents) -> Iterator[Path]:
    """Find files in the trees that are neither contents nor in shards; no link is followed."""
    known = {layout.observations / name for name in (*contents.images, "rig.json")}
    known |= {layout.identity, layout.manifest, *(tree / HASHES for tree in layout.trees)}
    shards = {layout.shard(tree, number) for tree in layout.trees for number in contents.shards}
    for tree in layout.trees:
        for folder, subfolders, files in os.walk(tree):
            path = Path(folder)
            linked = [name for name in subfolders if (path / name).is_symlink()]
            subfolders[:] = [name for name in subfolders if path / name not in shards]
            for name in (*linked, *files):
                if path / name not in known | shards:
                    yield path / name


def _recorded(tree: Path) -> dict[str, str] | None:
    """Read the table of a tree's hashes.json: None if it is missing, empty if it is damaged."""
    try:
        return parse_hashes((tree / HASHES).read_bytes()) or {}
    except OSError:
        return None


def _file(path: Path, recorded: str | None) -> str:
    """Compute the sha256 of a file. Raises DamageError unless it is the recorded one."""
    try:
        computed = None if path.is_symlink() else sha256(path)
    except FileNotFoundError as error:
        raise DamageError(f"{path}: is missing") from error
    except OSError as error:
        raise DamageError(f"{path}: cannot be read ({error.strerror})") from error
    if computed is None or computed != recorded:
        raise DamageError(f"{path}: is not what was generated")
    return computed


def _shard(folder: Path, names: Collection[str], recorded: str | None) -> str:
    """Compute the sha256 of an intact shard's hashes.json. Raises DamageError for a damaged shard.

    `recorded` is its sha256 in the tree's hashes.json, None if that is not written yet.
    """
    table = folder / HASHES
    try:
        data = table.read_bytes()
        present = {path.name for path in folder.iterdir()}
    except FileNotFoundError as error:
        raise DamageError(f"{table}: is missing") from error
    except OSError as error:
        raise DamageError(f"{table}: cannot be read ({error.strerror})") from error
    hashes = parse_hashes(data)
    if folder.is_symlink() or table.is_symlink() or hashes is None or hashes.keys() != set(names):
        raise DamageError(f"{table}: is not what was generated")
    if recorded not in (None, digest(data)):
        raise DamageError(f"{table}: is not what was generated")
    if surplus_names := sorted(present - {*names, HASHES}):
        raise DamageError(f"{folder / surplus_names[0]}: was not generated")
    for name in sorted(names):
        _file(folder / name, hashes[name])
    return digest(data)
