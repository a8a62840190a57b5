"""Writing of output files: parent folders are created, failures raise InputError."""

import tempfile
from collections.abc import Iterable
from pathlib import Path

from solver.instrument.errors import InputError
from solver.instrument.files import write_bytes


def prepare_output_path(path: Path, inputs: Iterable[Path] = ()) -> None:
    """Create the parent folders of `path`.

    Raises InputError if `path` could not be written, or is one of the files `inputs` that the
    command reads.
    """
    check_no_input(path, inputs)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        if path.is_dir():
            raise IsADirectoryError(0, "it is a folder")
        # Only a trial file shows whether the folder is writable.
        with tempfile.TemporaryFile(dir=path.parent):
            pass
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror})") from error


def prepare_output_and_page(out: Path, page: Path | None, inputs: Iterable[Path]) -> None:
    """Prepare the paths of an output and of its page, if there is one, as `prepare_output_path`."""
    check_two_files(out, page, "--page")
    read = tuple(inputs)
    for path in filter(None, (out, page)):
        prepare_output_path(path, read)


def check_two_files(out: Path | None, other: Path | None, option: str) -> None:
    """Raise InputError if an option's path is that of --out."""
    if out and other and other.resolve() == out.resolve():
        raise InputError(f"--out and {option} are both {out}, allowed are two files")


def check_no_input(path: Path, inputs: Iterable[Path]) -> None:
    """Raise InputError if an output path is one of the files `inputs`, or a folder with one."""
    if not path.exists():
        return
    is_folder = path.is_dir()
    for read in inputs:
        same = read.parent if is_folder else read
        if same.exists() and path.samefile(same):
            what = f"holds {read.name}, which is" if is_folder else "is"
            raise InputError(f"{path}: {what} read by this command; choose another name to write")


def write(path: Path, data: bytes) -> None:
    """Write `data` to `path` atomically. Raises InputError."""
    prepare_output_path(path)
    try:
        write_bytes(path, data)
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror})") from error
