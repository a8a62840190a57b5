"""Lock for one writer per dataset; it names its holder, and is freed when that process ends."""

import contextlib
import errno
import json
import os
import socket
import sys
import time
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import Final, NamedTuple

from solver.instrument.errors import InputError

# Errors of file systems without locks, such as some that clusters share.
_WITHOUT_LOCKS: Final = {errno.ENOLCK, errno.ENOSYS, errno.ENOTSUP, errno.EOPNOTSUPP}
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

    Where the file system has no locks, a second file beside it takes its place. If its holder has
    died on another machine, a person must delete it, as the message says.
    """
    descriptor, owner = _opened(path, time.monotonic() + wait_s)
    try:
        os.ftruncate(descriptor, 0)
        os.write(descriptor, _this_process())
        yield
    finally:
        if owner is not None:
            owner.unlink(missing_ok=True)
        if sys.platform == "win32":  # an open file cannot be removed there
            os.close(descriptor)
            with contextlib.suppress(OSError):
                path.unlink()
        else:
            path.unlink(missing_ok=True)
            os.close(descriptor)


class _Opened(NamedTuple):
    """Descriptor of the lock file, and the file in the place of a lock, if there is one."""

    descriptor: int
    owner: Path | None = None


def _opened(path: Path, deadline_s: float) -> _Opened:
    """Open and lock the lock file."""
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
        except OSError as error:
            if error.errno not in _WITHOUT_LOCKS:
                os.close(descriptor)
                raise
            return _Opened(descriptor, _owned(path.with_name(f"{path.name}.owner")))
        # The previous holder may have removed the file after we opened and before we locked it.
        with contextlib.suppress(FileNotFoundError):
            if os.path.samestat(os.fstat(descriptor), path.stat()):
                return _Opened(descriptor)
        os.close(descriptor)


def _owned(owner: Path) -> Path:
    """Create the file that takes the place of a lock. Raises InputError if it exists."""
    if _has_died(owner):
        owner.unlink(missing_ok=True)
    try:
        descriptor = os.open(owner, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o644)
    except FileExistsError as error:
        raise InputError(
            f"{owner.parent}: is being written by {_holder(owner)}; wait until it is done, or, if "
            f"it has died, delete {owner}"
        ) from error
    try:
        os.write(descriptor, _this_process())
    finally:
        os.close(descriptor)
    return owner


def _this_process() -> bytes:
    since = datetime.now(UTC).isoformat(timespec="seconds")
    return json.dumps({"pid": os.getpid(), "host": socket.gethostname(), "since": since}).encode()


def _has_died(owner: Path) -> bool:
    """Test whether the holder was a process of this machine that has ended."""
    try:
        holder = json.loads(owner.read_bytes())
        if holder["host"] != socket.gethostname() or sys.platform == "win32":
            return False
        os.kill(int(holder["pid"]), 0)
    except ProcessLookupError:
        return True
    except (OSError, ValueError, KeyError, TypeError):
        return False
    return False


def _holder(path: Path) -> str:
    try:
        holder = json.loads(path.read_text(encoding="utf-8"))
        return f"process {holder['pid']} on {holder['host']} since {holder['since']}"
    except (OSError, ValueError, KeyError, TypeError):
        return "another process"
