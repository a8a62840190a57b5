"""Reading of regular files, and atomic writing: write to a temporary file, fsync, rename."""

import errno
import hashlib
import io
import os
import stat
import time
from pathlib import Path
from typing import Final

NOT_REGULAR: Final = "it is not a regular file"
# A rename that Windows refuses is tried again for this time, at this interval [s]. Chosen: scanners
# hold a new file for a fraction of a second.
_MAX_REFUSED_S: Final = 2.0
_RETRY_S: Final = 0.02
_IS_WINDOWS: Final = os.name == "nt"


def open_regular(path: Path) -> io.BufferedReader:
    """Open a regular file for reading. Raises OSError, also for a pipe or a device.

    Reading those may never end, and opening a pipe waits for its writer.
    """
    # Neither flag exists on every system: Windows has no O_NONBLOCK, and only Windows O_BINARY.
    flags = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)
    descriptor = os.open(path, flags)
    mode = os.fstat(descriptor).st_mode
    if stat.S_ISREG(mode):
        return os.fdopen(descriptor, "rb")
    os.close(descriptor)
    if stat.S_ISDIR(mode):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    raise OSError(errno.EINVAL, NOT_REGULAR, str(path))


def read_regular(path: Path) -> bytes:
    """Read a regular file. Raises OSError."""
    with open_regular(path) as stream:
        return stream.read()


def holds(path: Path, data: bytes) -> bool:
    """Test whether a regular file has this content. Raises OSError."""
    return path.is_file() and read_regular(path) == data


def write_bytes(path: Path, data: bytes) -> None:
    """Write `data` to `path` atomically. Raises OSError."""
    temporary = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        with temporary.open("wb") as stream:
            stream.write(data)
            stream.flush()
            os.fsync(stream.fileno())
        move_into_place(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


def move_into_place(source: Path, target: Path) -> None:
    """Rename a file or folder to `target`, which it replaces. Raises OSError.

    Windows refuses this while another process, often a virus scanner, has either of them open.
    """
    end = time.monotonic() + _MAX_REFUSED_S
    while True:
        try:
            source.replace(target)
            return
        except PermissionError:
            if not _IS_WINDOWS or time.monotonic() > end:
                raise
        time.sleep(_RETRY_S)


def write_text(path: Path, text: str) -> None:
    """Write UTF-8 text as `write_bytes` does. Raises OSError."""
    write_bytes(path, text.encode("utf-8"))


def sync_folder(folder: Path) -> None:
    """Wait until the names in a folder are on the disk. Raises OSError."""
    if _IS_WINDOWS:  # it cannot open folders, and journals renames itself
        return
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def sha256(path: Path) -> str:
    """Compute the sha256 of a regular file, in hexadecimal. Raises OSError."""
    with open_regular(path) as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()
