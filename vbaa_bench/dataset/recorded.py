"""Files of results with their sha256 in the hashes.json of their folder.

These are the files in predictions/, scores/, derived/ and report/ of a dataset, and collection.json
and rigs.csv of a collection. Unlike the files of the two trees, they are replaced by later
commands. A file that a user has added by hand is not in hashes.json and is read without a check.
"""

from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Final

from solver.instrument.errors import DamageError, InputError
from solver.instrument.files import move_into_place, sync_folder, write_bytes
from solver.instrument.hashes import HASHES, MEND, digest, hashes_bytes, read_hashes
from vbaa_bench.dataset.lock import locked, writing

# Longest wait for another process that writes into the same folder [s]. Chosen: a thousand times
# what a write takes.
_WAIT_S: Final = 30.0


def write_recorded(
    folder: Path,
    files: Mapping[str, bytes],
    removed: Collection[str] = (),
    digests: Mapping[str, str] | None = None,
) -> None:
    """Write the files of a folder by name, and record their sha256 in its hashes.json.

    `removed` are names of files that are deleted, `digests` the sha256 of other files that the
    caller writes. After a crash every file is the old or the new one, and one that does not match
    hashes.json is reported when it is read. Raises OSError, where a full disk changes no file;
    InputError if another process keeps writing into the folder.
    """
    folder.mkdir(parents=True, exist_ok=True)
    aside = {name: folder / f".{name}.new" for name in files}
    with locked(folder / ".hashes.lock", wait_s=_WAIT_S):
        try:
            for name, data in files.items():
                write_bytes(aside[name], data)
            kept = {name: value for name, value in _table(folder).items() if name not in removed}
            written = {name: digest(data) for name, data in files.items()}
            # The hashes come first: files of two runs are never mixed without a message.
            write_bytes(folder / HASHES, hashes_bytes(kept | dict(digests or {}) | written))
            for name, path in aside.items():
                move_into_place(path, folder / name)
            for name in removed:
                (folder / name).unlink(missing_ok=True)
            sync_folder(folder)
        finally:
            for path in aside.values():
                path.unlink(missing_ok=True)


def write_results(folder: Path, files: Mapping[str, bytes], removed: Collection[str] = ()) -> None:
    """Write files as `write_recorded` does. Raises InputError."""
    with writing(folder):
        write_recorded(folder, files, removed)


def exists(path: Path) -> bool:
    """Test whether a file of results exists. Raises DamageError if it does not, but is recorded."""
    try:
        if path.is_file():
            return True
        recorded = path.name in (read_hashes(path.parent) or {})
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from error
    if recorded:
        raise DamageError(f"{path}: is missing; {MEND}")
    return False


def check_none_missing(folder: Path) -> None:
    """Raise DamageError if a recorded file of a folder is missing."""
    for name in read_hashes(folder) or {}:
        exists(folder / name)


def _table(folder: Path) -> dict[str, str]:
    """Read the hashes of a folder; those of a damaged table are lost, and `verify` reports it."""
    try:
        return read_hashes(folder) or {}
    except DamageError:
        return {}
