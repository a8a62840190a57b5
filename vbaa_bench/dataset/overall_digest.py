"""One digest over a whole dataset or collection, by which a copy of it is known to be the same.

It is the sha256 of lines as `sha256sum` prints them, sorted by name: those of the hashes.json of
both trees of a dataset, which list the sha256 of all other files of their trees, and of a
collection those of its own hashes.json and of both of every rig. In the folder of a dataset or of a
collection, this prints the same digest:

  sha256sum observations/hashes.json truth/hashes.json | sha256sum
  sha256sum hashes.json rig_*/{observations,truth}/hashes.json | LC_ALL=C sort -k 2 | sha256sum

The hashes protect against accidents: who changes a file and rewrites the tables of hashes as well
goes unnoticed, unless the digest is compared with one that was noted elsewhere. `generate` prints
it, the card of an export and its Croissant carry it, and `verify --against DIGEST` compares it.
Results (predictions/, scores/, derived/, report/) do not belong to it.
"""

import re
from pathlib import Path
from typing import Final

from solver.instrument.errors import InputError
from solver.instrument.files import sha256
from solver.instrument.hashes import HASHES, digest
from vbaa_bench.dataset.collection import CollectionLayout, is_collection
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.dataset.readers import check_complete

_DIGEST: Final = re.compile(r"[0-9a-f]{64}")


def dataset_digest(root: Path) -> str:
    """Compute the digest of a dataset or collection. Raises InputError if it is incomplete."""
    if is_collection(root):
        collection = CollectionLayout(root)
        rigs = list(collection.rigs().values())
        paths = [root / HASHES] if (root / HASHES).is_file() else []
    else:
        rigs, paths = [Layout(root)], []
        check_complete(rigs[0])
    paths += [tree / HASHES for rig in rigs for tree in rig.trees]
    named = {path.relative_to(root).as_posix(): path for path in paths}
    try:
        lines = [f"{sha256(path)}  {name}\n" for name, path in sorted(named.items())]
    except OSError as error:
        raise InputError(f"{root}: cannot be read ({error.strerror})") from error
    return digest("".join(lines).encode())


def checked_digest(text: str) -> str:
    """Return a digest that a user has stated. Raises InputError if it is none."""
    if not _DIGEST.fullmatch(text.lower()):
        raise InputError(
            f"--against has {len(text)} characters, allowed are the 64 hexadecimal digits that "
            "generate prints"
        )
    return text.lower()
