"""Writing of output files: parent folders are created, failures raise InputError."""

import tempfile
from pathlib import Path

from solver.instrument.errors import InputError
from solver.instrument.files import write_bytes


def prepare_output_path(path: Path) -> None:
    """Create the parent folders of `path`. Raises InputError if `path` could not be written."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        if path.is_dir():
            raise IsADirectoryError(0, "it is a folder")
        # Only a trial file shows whether the folder is writable.
        with tempfile.TemporaryFile(dir=path.parent):
            pass
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror})") from error


def write(path: Path, data: bytes) -> None:
    """Write `data` to `path` atomically. Raises InputError."""
    prepare_output_path(path)
    try:
        write_bytes(path, data)
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror})") from error
