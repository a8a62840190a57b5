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
from solver.instrument.files import read_regular

# Errors of file systems without locks, such as some that clusters share.
_WITHOUT_LOCKS: Final = {errno.ENOLCK, errno.ENOSYS, errno.ENOTSUP, errno.EOPNOTSUPP}
# Interval at which a held lock is tried again [s].
_POLL_S: Final = 0.01


class FolderError(InputError):
    """Error for a folder of data: not writable, held by another process, or with other data.

    It is never a property of a scene or of a rig.
    """


@contextlib.contextmanager
def writing(folder: Path) -> Iterator[None]:
    """Write to a folder of data in this block. Raises FolderError in place of OSError."""
    try:
        yield
    except OSError as error:
        raise FolderError(f"{folder}: cannot be written ({error.strerror or error})") from error


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
    block others. Raises FolderError, which names the holder, if another process has the lock for
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
    """Open and lock the lock file. Raises FolderError after the deadline, and OSError."""
    while True:
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT, 0o644)
        try:
            owner = _owned(path, descriptor)
            # The previous holder may have removed the file after we opened and before we locked it.
            if owner is not None or _is_same(descriptor, path):
                return _Opened(descriptor, owner)
        except (BlockingIOError, PermissionError, FileExistsError) as error:
            if time.monotonic() > deadline_s:
                os.close(descriptor)
                raise FolderError(_refusal(path, isinstance(error, FileExistsError))) from error
            time.sleep(_POLL_S)
        except OSError:
            os.close(descriptor)
            raise
        os.close(descriptor)


def _owned(path: Path, descriptor: int) -> Path | None:
    """Lock an open file; or, where there are no locks, create and return a file in its place.

    Raises FileExistsError if that exists, and another OSError if the lock is held.
    """
    try:
        _acquire(descriptor)
    except OSError as error:
        if error.errno not in _WITHOUT_LOCKS:
            raise
    else:
        return None
    owner = _owner(path)
    if _has_died(owner):
        owner.unlink(missing_ok=True)
    created = os.open(owner, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o644)
    try:
        os.write(created, _this_process())
    finally:
        os.close(created)
    return owner


def _owner(path: Path) -> Path:
    return path.with_name(f"{path.name}.owner")


def _is_same(descriptor: int, path: Path) -> bool:
    try:
        return os.path.samestat(os.fstat(descriptor), path.stat())
    except FileNotFoundError:
        return False


def _refusal(path: Path, without_locks: bool) -> str:
    holder = _owner(path) if without_locks else path
    remedy = f"if it has died, delete {holder}" if without_locks else "choose another folder"
    return (
        f"{path.parent}: is being written by {_holder(holder)}; wait until it is done, or {remedy}"
    )


def _this_process() -> bytes:
    since = datetime.now(UTC).isoformat(timespec="seconds")
    return json.dumps({"pid": os.getpid(), "host": socket.gethostname(), "since": since}).encode()


def _has_died(owner: Path) -> bool:
    """Test whether the holder was a process of this machine that has ended."""
    try:
        holder = json.loads(read_regular(owner))
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
        holder = json.loads(read_regular(path))
        return f"process {holder['pid']} on {holder['host']} since {holder['since']}"
    except (OSError, ValueError, KeyError, TypeError):
        return "another process"
