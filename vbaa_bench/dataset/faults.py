"""Faults of files: what is wrong with one, by its recorded sha256."""

import os
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Final, NamedTuple

from solver.instrument.files import read_regular, sha256
from solver.instrument.hashes import HASHES, digest, parse_hashes

MISSING: Final = "missing"
DAMAGED: Final = "damaged"
SURPLUS: Final = "surplus"
FOREIGN: Final = "foreign"
INCOMPLETE: Final = "incomplete"
LINK: Final = "link"
VERSION: Final = "version"
UNRECORDED: Final = "unrecorded"


class Fault(NamedTuple):
    """A file or folder, its kind of fault, and what is wrong with it."""

    path: Path
    kind: str
    detail: str

    def __str__(self) -> str:
        return f"{self.path}: {self.detail}"


def missing(path: Path) -> Fault:
    """Return the fault of a file that does not exist."""
    return Fault(path, MISSING, "is missing")


def damaged(path: Path) -> Fault:
    """Return the fault of a file with another content."""
    return Fault(path, DAMAGED, "is not what was generated")


def surplus(path: Path) -> Fault:
    """Return the fault of a file that no command has written."""
    return Fault(path, SURPLUS, "was not generated")


def file_fault(path: Path, recorded: str) -> Fault | None:
    """Compare a file with its recorded sha256; return what is wrong with it."""
    if path.is_symlink():
        return Fault(path, LINK, "is a link, allowed is the file that was generated")
    try:
        return None if sha256(path) == recorded else damaged(path)
    except FileNotFoundError:
        return missing(path)
    except OSError as error:
        return Fault(path, DAMAGED, f"cannot be read ({error.strerror})")


class HashTable(NamedTuple):
    """The hashes.json of a folder: its hashes by name, None with a fault; and its own sha256."""

    hashes: dict[str, str] | None
    digest: str
    fault: Fault | None


def read_hash_table(folder: Path, recorded: str | None = None) -> HashTable:
    """Read the hashes.json of a folder, whose sha256 is `recorded` if that is known."""
    path = folder / HASHES
    if folder.is_symlink() or path.is_symlink():
        return HashTable(None, "", Fault(path, LINK, "is a link, allowed is what was generated"))
    try:
        data = read_regular(path)
    except FileNotFoundError:
        return HashTable(None, "", missing(path))
    except OSError as error:
        return HashTable(
            None, "", Fault(path, DAMAGED, f"cannot be read ({error.strerror or error})")
        )
    hashes = parse_hashes(data)
    if hashes is None or recorded not in (None, digest(data)):
        return HashTable(None, "", damaged(path))
    return HashTable(hashes, digest(data), None)


def folder_faults(folder: Path, table: HashTable) -> Iterator[Fault]:
    """Compare all files of a folder without subfolders with its table."""
    if table.hashes is None:
        if table.fault is not None:
            yield table.fault
        return
    present = {path.name for path in folder.iterdir()}
    for name in sorted(present - table.hashes.keys() - {HASHES}):
        yield surplus(folder / name)
    for name, recorded in sorted(table.hashes.items()):
        fault = file_fault(folder / name, recorded)
        if fault is not None:
            yield fault


def name_faults(folder: Path, table: HashTable, names: Collection[str]) -> Iterator[Fault]:
    """Compare the names that a table lists with those that it should list."""
    if table.hashes is not None and table.hashes.keys() != set(names):
        yield damaged(folder / HASHES)


def unlisted_files(
    tree: Path, listed: Collection[Path], folders: Collection[Path]
) -> Iterator[Path]:
    """Find files of a tree that are neither listed nor in `folders`; no link is followed."""
    for folder, subfolders, files in os.walk(tree):
        path = Path(folder)
        linked = [name for name in subfolders if (path / name).is_symlink()]
        subfolders[:] = sorted(name for name in subfolders if path / name not in folders)
        for name in sorted((*linked, *files)):
            if path / name not in listed and path / name not in folders:
                yield path / name
