"""The last step of a copied dataset: what was written is verified, then the hashes complete it."""

import os
from collections.abc import Mapping

from solver.instrument.errors import DamageError
from solver.instrument.files import write_bytes
from solver.instrument.hashes import HASHES, hashes_bytes
from vbaa_bench.dataset.faults import file_fault, folder_faults, table_of
from vbaa_bench.dataset.layout import Layout


def seal_copy(layout: Layout, tables: Mapping[str, Mapping[str, str]]) -> None:
    """Verify all files of a dataset that was copied; write the hashes.json of both trees.

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
                faults = [*folder_faults(folder, table_of(folder, recorded))]
            else:
                fault = file_fault(tree / name, recorded)
                faults = [] if fault is None else [fault]
            if faults:
                raise DamageError(f"{faults[0]}; the copy is incomplete, delete it and try again")
    for tree in layout.trees:  # the observations' hashes complete the dataset
        write_bytes(tree / HASHES, hashes_bytes(tables[tree.name]))
