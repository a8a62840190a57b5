"""Integrity check of generated folders: hashes.json lists the sha256 of each file.

The hashes.json of a tree lists the files of the tree and the hashes.json of each shard, which
lists the files of the shard. The tree's hashes.json is written last, atomically: a tree that has
one is complete. Every file is checked when it is read. A laboratory's folder has no hashes.json,
and its files are read without a check.
"""

import functools
import hashlib
import json
from pathlib import Path
from typing import Final

from solver.instrument.errors import DamageError, InputError

HASHES: Final = "hashes.json"
MEND: Final = "run the command that made it again to replace damaged files"


def digest(data: bytes) -> str:
    """Compute the sha256 of bytes, in hexadecimal."""
    return hashlib.sha256(data).hexdigest()


def read_bytes(path: Path) -> bytes:
    """Read a file; if a hashes.json lists it, check its sha256.

    Raises InputError if it cannot be read, DamageError if it is not what was generated.
    """
    expected = _recorded(path)
    try:
        # Reading a pipe or a device may never end; reading a folder raises its own clear error.
        if path.exists() and not path.is_file() and not path.is_dir():
            raise InputError(f"{path}: cannot be read (it is no file)")
        data = path.read_bytes()
    except FileNotFoundError as error:
        if expected is not None:
            raise DamageError(f"{path}: is missing; {MEND}") from error
        raise InputError(f"{path}: cannot be read ({error.strerror})") from error
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from error
    if expected not in (None, digest(data)):
        raise DamageError(f"{path}: is not what was generated; {MEND}")
    return data


def _recorded(path: Path) -> str | None:
    """Look up the sha256 in the hashes.json beside the file or one folder above; None if absent."""
    for folder in path.parents[:2]:
        if folder / HASHES != path and (folder / HASHES).is_file():
            table = read_hashes(folder)
            if table and (name := path.relative_to(folder).as_posix()) in table:
                return table[name]
    return None


def read_hashes(folder: Path) -> dict[str, str] | None:
    """Read the hashes.json of a folder, as file name to sha256; return None if there is none.

    Raises InputError if it cannot be read, DamageError if it is not what was written.
    """
    path = folder / HASHES
    try:
        file = path.stat()
    except OSError:
        return None
    return _read_hashes(path, (file.st_ino, file.st_mtime_ns, file.st_size)).copy()


# The tree's table is needed for every file of a shard, and has a line for every shard.
@functools.lru_cache(maxsize=4)
def _read_hashes(path: Path, _version: tuple[int, int, int]) -> dict[str, str]:
    table = parse_hashes(read_bytes(path))
    if table is None:
        raise DamageError(f"{path}: is not a JSON object of names and hashes; {MEND}")
    return table


def parse_hashes(data: bytes) -> dict[str, str] | None:
    """Parse the bytes of a hashes.json; return None if they are not valid."""
    try:
        table = json.loads(data)
    except (ValueError, RecursionError):
        return None
    if not isinstance(table, dict) or not all(isinstance(value, str) for value in table.values()):
        return None
    return table


def listed(tree: Path) -> list[str] | None:
    """List the files of a generated tree, sorted; return None if the folder was not generated.

    Their bytes are checked when they are read. Raises InputError if the tree is incomplete,
    DamageError if a listed file is missing.
    """
    table = read_hashes(tree)
    if table is None:
        if any(tree.glob(f"shard_*/{HASHES}")):
            raise InputError(
                f"{tree}: is incomplete; run the command that made it again to finish it"
            )
        return None
    names = set(table)
    for name in table:
        folder, _, file_name = name.rpartition("/")
        if folder and file_name == HASHES:
            names |= {f"{folder}/{listed_name}" for listed_name in read_hashes(tree / folder) or {}}
    for name in sorted(names):
        if not (tree / name).is_file():
            raise DamageError(f"{tree / name}: is missing; {MEND}")
    return sorted(names)
