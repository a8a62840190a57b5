"""Watch what a case does outside of its folder: files written or read, processes, unpickling.

Python's audit events show everything that Python code opens, moves or starts. Files that compiled
code writes raise no events; those in the surroundings of the folder are found by comparing a
listing of names, sizes and times before and after.
"""

import os
import sys
import sysconfig
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final, NamedTuple

_WRITING: Final = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND
# Audit events whose first argument, or first two, are paths that are changed.
_CHANGES: Final = {
    **dict.fromkeys(("os.remove", "os.mkdir", "os.rmdir", "os.truncate", "os.chmod"), 1),
    **dict.fromkeys(("os.chown", "os.utime", "os.setxattr"), 1),
    **dict.fromkeys(("os.rename", "os.link", "os.symlink"), 2),
}
# Events that no input may cause.
_FORBIDDEN: Final = {
    *("subprocess.Popen", "os.system", "os.exec", "os.posix_spawn", "os.fork", "os.forkpty"),
    *("socket.connect", "socket.bind", "pickle.find_class", "ctypes.dlopen"),
}
# Files of the system that libraries read, and devices without content.
_SYSTEM: Final = ("/proc", "/sys", "/dev/null", "/dev/urandom", "/etc/localtime", "/usr", "/lib")


class _Entry(NamedTuple):
    size: int
    modified_ns: int
    inode: int


Listing = dict[str, _Entry]


def listing(*roots: Path) -> Listing:
    """List the files and folders below some folders, with what changes when one is written."""
    entries = {}
    for root in roots:
        for folder, folders, files in os.walk(root):
            for name in (*folders, *files):
                path = os.path.join(folder, name)  # noqa: PTH118  # four times faster than Path
                stat = os.lstat(path)
                size = 0 if name in folders else stat.st_size
                entries[path] = _Entry(
                    size, 0 if name in folders else stat.st_mtime_ns, stat.st_ino
                )
    return entries


def changes(before: Listing, after: Listing) -> list[str]:
    """Describe the differences between two listings."""
    return [
        f"{'changed' if path in before and path in after else 'new' if path in after else 'gone'}"
        f": {path}"
        for path in sorted(before.keys() | after.keys())
        if before.get(path) != after.get(path)
    ]


def _called_by_numba() -> bool:
    frame = sys._getframe()
    while frame.f_back is not None:
        if str(frame.f_globals.get("__name__")).startswith("numba."):
            return True
        frame = frame.f_back
    return False


class Watch:
    """Record of forbidden events. An audit hook cannot be removed: make one for each process."""

    def __init__(self, readable: tuple[Path, ...]) -> None:
        """Watch; files below `readable` and those of Python may be read."""
        packages = [Path(__file__).parents[3] / name for name in ("solver", "vbaa_bench")]
        installed = {*sysconfig.get_paths().values(), sys.base_prefix, *map(str, packages)}
        self._readable = (
            *(os.path.realpath(str(path)) for path in (*readable, *installed)),
            *_SYSTEM,
        )
        self._caches = (str(Path.home() / ".drjit"), str(Path.home() / ".cache"))
        self._folder = ""
        self._events: list[str] = []
        sys.addaudithook(self._on_event)

    @contextmanager
    def confined(self, folder: Path) -> Iterator[list[str]]:
        """Allow changes within `folder` only; yield the list of forbidden events."""
        self._events = []
        self._folder = str(folder)
        try:
            yield self._events
        finally:
            self._folder = ""

    def _on_event(self, event: str, arguments: tuple[Any, ...]) -> None:
        if not self._folder:
            return
        if event == "pickle.find_class" and _called_by_numba():
            return  # its cache of compiled functions
        if event in _FORBIDDEN:
            self._events.append(f"{event}: {str(arguments)[:200]}")
        elif event == "open":
            path, _, flags = arguments
            if flags & _WRITING:
                self._check_change("open for writing", path)
            elif not self._within(path, (self._folder, *self._readable)):
                self._events.append(f"open for reading: {path}")
        elif event in _CHANGES:
            for path in arguments[: _CHANGES[event]]:
                self._check_change(event, path)

    def _check_change(self, event: str, path: Any) -> None:
        cache = "__pycache__" in str(path)  # compiled code, wherever it is installed
        if not cache and not self._within(path, (self._folder, *self._caches, "/dev/null")):
            self._events.append(f"{event}: {path}")

    @staticmethod
    def _within(path: Any, roots: tuple[str, ...]) -> bool:
        if isinstance(path, int):  # a file that is open already
            return True
        resolved = os.path.realpath(os.fsdecode(path))
        return any(resolved == root or resolved.startswith(f"{root}/") for root in roots)
