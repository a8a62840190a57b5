"""Lock for one writer per dataset; it names its holder, and is freed when that process ends."""

import contextlib
import json
import os
import socket
import sys
import time
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

from solver.instrument.errors import InputError

# Interval at which a held lock is tried again [s].
_POLL_S: Final = 0.01

if sys.platform == "win32":
    import msvcrt

    # On Windows other processes cannot read locked bytes: lock a byte far behind the holder's
    # name.
    _LOCKED_BYTE = 1 << 30

    def _acquire(descriptor: int) -> None:
        os.lseek(descriptor, _LOCKED_BYTE, os.SEEK_SET)
        msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)
        os.lseek(descriptor, 0, os.SEEK_SET)
else:
    import fcntl

    def _acquire(descriptor: int) -> None:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)


@contextlib.contextmanager
def locked(path: Path, wait_s: float = 0.0) -> Iterator[None]:
    """Hold the lock file `path`; it is removed at the end.

    The operating system frees the lock of a process that has died, so a leftover file does not
    block others. Raises InputError, which names the holder, if another process has the lock for
    longer than `wait_s`, and OSError if the file cannot be written.
    """
    descriptor = _opened(path, time.monotonic() + wait_s)
    try:
        os.ftruncate(descriptor, 0)
        since = datetime.now(UTC).isoformat(timespec="seconds")
        holder = {"pid": os.getpid(), "host": socket.gethostname(), "since": since}
        os.write(descriptor, json.dumps(holder).encode())
        yield
    finally:
        if sys.platform == "win32":  # an open file cannot be removed there
            os.close(descriptor)
            with contextlib.suppress(OSError):
                path.unlink()
        else:
            path.unlink(missing_ok=True)
            os.close(descriptor)


def _opened(path: Path, deadline_s: float) -> int:
    """Open and lock the lock file; return its descriptor."""
    while True:
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT, 0o644)
        try:
            _acquire(descriptor)
        except (BlockingIOError, PermissionError) as error:
            os.close(descriptor)
            if time.monotonic() < deadline_s:
                time.sleep(_POLL_S)
                continue
            raise InputError(
                f"{path.parent}: is being written by {_holder(path)}; wait until it is done, "
                "or choose another folder"
            ) from error
        # The previous holder may have removed the file after we opened and before we locked it.
        with contextlib.suppress(FileNotFoundError):
            if os.path.samestat(os.fstat(descriptor), path.stat()):
                return descriptor
        os.close(descriptor)


def _holder(path: Path) -> str:
    try:
        holder = json.loads(path.read_text(encoding="utf-8"))
        return f"process {holder['pid']} on {holder['host']} since {holder['since']}"
    except (OSError, ValueError, KeyError, TypeError):
        return "another process"
