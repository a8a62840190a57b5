"""Integrity check of generated folders: hashes.json lists the sha256 of each file.

The hashes.json of a tree lists the files of the tree and the hashes.json of each shard, which
lists the files of the shard. The tree's hashes.json is written last, atomically: a tree that has
one is complete. Every file is checked when it is read. A laboratory's folder has no hashes.json,
and its files are read without a check. Names are those of files within the folder: absolute paths,
`..` and links are refused.

The first entry of a table, under its own name, is the sha256 of its other bytes.
"""

import functools
import hashlib
import json
import operator
import os
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Final

from solver.instrument.errors import DamageError, InputError
from solver.instrument.files import open_regular

HASHES: Final = "hashes.json"
MEND: Final = "run the command that made it again to replace damaged files"
# Largest table [bytes]: that of a million files, whose names have up to 60 characters.
_MAX_TABLE_BYTES: Final = 1 << 27
# A file in the folder or in folders below it; no part is `.` or `..`.
_INSIDE: Final = re.compile(r"(?!\.{1,2}(/|\Z))[^/\0]+(/(?!\.{1,2}(/|\Z))[^/\0]+)*")
# Bytes before a table's own sha256, and their number.
_HEAD: Final = f'{{\n  "{HASHES}": "'.encode()
_DIGITS: Final = 64
_ELSEWHERE: Final = re.compile(r"[:\\]" if os.name == "nt" else r"\0")


def digest(data: bytes) -> str:
    """Compute the sha256 of bytes, in hexadecimal."""
    return hashlib.sha256(data).hexdigest()


def read_bytes(path: Path, max_bytes: int | None = None) -> bytes:
    """Read a regular file of at most `max_bytes`; if a hashes.json lists it, check its sha256.

    Raises InputError if it cannot be read, DamageError if it is not what was generated or a link.
    """
    expected = _recorded(path)
    try:
        with open_regular(path) as stream:
            if max_bytes is not None and os.fstat(stream.fileno()).st_size > max_bytes:
                raise InputError(f"{path}: is too large, allowed are {max_bytes:,} bytes")
            data = stream.read()
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
    """Look up the sha256 in the hashes.json beside the file or one folder above; None if absent.

    Raises DamageError if the file, or its folder below that of the table, is a link.
    """
    for depth, folder in enumerate(path.parents[:2]):
        if folder / HASHES == path:
            continue
        table = _table(folder)
        if table and (name := path.relative_to(folder).as_posix()) in table:
            for part in (path, *path.parents[:depth]):
                if part.is_symlink():
                    raise DamageError(f"{part}: is a link, allowed is the file that was generated")
            return table[name]
    return None


def read_hashes(folder: Path) -> dict[str, str] | None:
    """Read the hashes.json of a folder, as file name to sha256; return None if there is none.

    Raises InputError if it cannot be read, DamageError if it is not what was written.
    """
    table = _table(folder)
    return None if table is None else dict(table)


def _table(folder: Path) -> Mapping[str, str] | None:
    path = folder / HASHES
    try:
        file = path.stat()
    except OSError:
        return None
    return _read_hashes(path, (file.st_ino, file.st_mtime_ns, file.st_size))


# The tree's table is needed for every file of a shard, and has a line for every shard. A thread
# that reads a shard needs the tables of the shard and of the tree.
@functools.lru_cache(maxsize=16)
def _read_hashes(path: Path, _version: tuple[int, int, int]) -> Mapping[str, str]:
    table = parse_hashes(read_bytes(path, _MAX_TABLE_BYTES))
    if table is None:
        raise DamageError(
            f"{path}: is not a JSON object of hashes by names of files in this folder; {MEND}"
        )
    return table


def hashes_bytes(table: Mapping[str, str]) -> bytes:
    """Encode a table of names and sha256 as the content of hashes.json."""
    data = (json.dumps({HASHES: "", **dict(sorted(table.items()))}, indent=2) + "\n").encode()
    start = len(_HEAD)
    return data[:start] + digest(data).encode() + data[start:]


def checks_itself(data: bytes) -> bool:
    """Test whether the bytes of a hashes.json include their own sha256, right or wrong.

    Tables of old datasets do not. One byte before it may be damaged: a name in its place differs by
    more.
    """
    head = data[: len(_HEAD)]
    return len(head) == len(_HEAD) and sum(map(operator.ne, head, _HEAD)) <= 1


# Longest name of a file with its folders. Chosen: twice that of a file with a long name of a user.
MAX_NAME: Final = 600


def parse_hashes(data: bytes) -> dict[str, str] | None:
    """Parse the bytes of a hashes.json; return None if they are not valid."""
    if checks_itself(data):
        start, end = len(_HEAD), len(_HEAD) + _DIGITS
        if digest(data[:start] + data[end:]).encode() != data[start:end]:
            return None
    try:
        table = json.loads(data)
    except (ValueError, RecursionError):
        return None
    if not isinstance(table, dict) or not all(isinstance(value, str) for value in table.values()):
        return None
    if any(not _INSIDE.fullmatch(name) or _ELSEWHERE.search(name) for name in table):
        return None
    if any(len(name) > MAX_NAME or not name.isprintable() for name in table):
        return None
    table.pop(HASHES, None)
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
    # Listing a folder is much faster than a question for each of its files.
    folders = {name.rpartition("/")[0] for name in names}
    present = {folder: _files_in(tree / folder) for folder in folders}
    for name in sorted(names):
        folder, _, file_name = name.rpartition("/")
        if file_name not in present[folder]:
            raise DamageError(f"{tree / name}: is missing; {MEND}")
    return sorted(names)


def _files_in(folder: Path) -> set[str]:
    try:
        with os.scandir(folder) as entries:
            return {entry.name for entry in entries if entry.is_file()}
    except OSError:
        return set()
