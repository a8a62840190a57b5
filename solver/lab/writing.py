"""Writing what was asked for: folders are made on the way, and what cannot be written is named."""

import tempfile
from pathlib import Path

from solver.instrument.errors import InputError
from solver.instrument.files import write_bytes


def make_room(path: Path) -> None:
    """Make the folders that lead to `path`; raises InputError where it could not be written."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        if path.is_dir():
            raise IsADirectoryError(0, "it is a folder")
        # Whether a folder takes a file is told by one alone.
        with tempfile.TemporaryFile(dir=path.parent):
            pass
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror})") from error


def write(path: Path, data: bytes) -> None:
    """Write `data` to `path`, whole or not at all. Raises InputError."""
    make_room(path)
    try:
        write_bytes(path, data)
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror})") from error
