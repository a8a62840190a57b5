"""Copies of datasets and their trees: each file is checked as it is read, and as it was written."""

import contextlib
import os
from collections.abc import Iterator, Mapping
from pathlib import Path

from solver.instrument.errors import DamageError, InputError
from solver.instrument.files import read_regular, write_bytes
from solver.instrument.hashes import HASHES, MEND, hashes_bytes, listed, read_bytes, read_hashes
from vbaa_bench.dataset.faults import file_fault, folder_faults, read_hash_table
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.dataset.lock import writing
from vbaa_bench.dataset.readers import check_complete


@contextlib.contextmanager
def new_folder(folder: Path) -> Iterator[None]:
    """Fill a new folder in this block. Raises InputError if it has files or cannot be written."""
    with writing(folder):
        if folder.exists() and any(folder.iterdir()):
            raise InputError(f"{folder}: is not empty; choose another folder")
        yield


def complete_table(tree: Path) -> dict[str, str]:
    """Read the hashes.json of a tree. Raises InputError if there is none."""
    table = read_hashes(tree)
    if table is None:
        raise InputError(f"{tree}: is incomplete, {HASHES} is missing; {MEND}")
    return table


def copy_observations(layout: Layout, target: Path) -> None:
    """Copy a dataset's observations to a new folder, and check each file as it is read.

    Only the files listed in hashes.json are copied; no link to other files is followed. Raises
    InputError for an incomplete or damaged tree, OSError if `target` cannot be written.
    """
    check_complete(layout)
    copy_tree(layout.observations, target)
    (target / HASHES).write_bytes(read_regular(layout.observations / HASHES))


def copy_tree(source: Path, target: Path) -> None:
    """Copy the files of a tree, except its own hashes.json, and check each as it is read.

    Only files that hashes.json lists are copied. Raises InputError for a damaged tree, OSError if
    `target` cannot be written.
    """
    for name in listed(source) or []:
        (target / name).parent.mkdir(parents=True, exist_ok=True)
        (target / name).write_bytes(read_bytes(source / name))


def seal_copy(layout: Layout, tables: Mapping[str, Mapping[str, str]]) -> None:
    """Verify a copy of a dataset, and complete it by the hashes.json of both trees.

    `tables` are the hashes of each tree by its name. Raises DamageError for a file that is not what
    was written, and then the dataset stays incomplete; OSError if it cannot be written.
    """
    if hasattr(os, "sync"):  # a million files are not synced one by one; not on Windows
        os.sync()
    for tree in layout.trees:
        for name, recorded in tables[tree.name].items():
            shard, _, last = name.rpartition("/")
            if shard and last == HASHES:
                folder = tree / shard
                faults = [*folder_faults(folder, read_hash_table(folder, recorded))]
            else:
                fault = file_fault(tree / name, recorded)
                faults = [] if fault is None else [fault]
            if faults:
                raise DamageError(f"{faults[0]}; the copy is incomplete, delete it and try again")
    for tree in layout.trees:  # the observations' hashes complete the dataset
        write_bytes(tree / HASHES, hashes_bytes(tables[tree.name]))
