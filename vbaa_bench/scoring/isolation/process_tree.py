"""Descendants of this process on Linux: find them, measure their memory, end them all.

Elsewhere there are none to be found, and a group of processes is all that can be ended.
"""

import contextlib
import ctypes
import os
import signal
import sys
import time
from collections import defaultdict
from pathlib import Path
from typing import Final

# Longest time to end all descendants [s]. Chosen: only a process that waits for a device, or one
# that starts others faster than they are killed, is left.
_MAX_END_S: Final = 5.0
# Options of Linux's prctl (sys/prctl.h).
_PR_SET_PDEATHSIG: Final = 1
_PR_SET_CHILD_SUBREAPER: Final = 36


def adopt_orphans() -> None:
    """Become the parent of every descendant whose own parent has ended, a daemon's also."""
    _prctl(_PR_SET_CHILD_SUBREAPER, 1)


def end_with_parent() -> None:
    """Let this process be killed when its parent ends."""
    _prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)


def descendants() -> list[int]:
    """List the processes that this process and its descendants have started."""
    if sys.platform != "linux":
        return []
    children = defaultdict[int, list[int]](list)
    for pid in [int(path.name) for path in Path("/proc").iterdir() if path.name.isdigit()]:
        if stat := _read(pid, "stat"):
            # After the name, which may contain anything: the state and the parent.
            parent = stat.rpartition(b")")[2].split()[1]
            children[int(parent)].append(pid)
    found, pending = list[int](), [os.getpid()]
    while pending:
        started = children[pending.pop()]
        found += started
        pending += started
    return found


def end_descendants() -> None:
    """Kill all descendants, also those that are started meanwhile, and reap them."""
    end = time.monotonic() + _MAX_END_S
    while (started := descendants()) and time.monotonic() < end:
        for pid in started:
            with contextlib.suppress(ProcessLookupError, PermissionError):
                os.kill(pid, signal.SIGKILL)
        with contextlib.suppress(ChildProcessError):
            while os.waitpid(-1, os.WNOHANG)[0]:
                pass
        time.sleep(0.001)


def largest_memory() -> int:
    """Return the memory of the largest descendant [bytes], its shared mappings included."""
    return max((_memory(pid) for pid in descendants()), default=0)


def processor_seconds(pid: int) -> float | None:
    """Return the processor time that a process has used [s]; None if this system does not say."""
    if sys.platform != "linux":
        return None
    with contextlib.suppress(OSError):
        # The number of a process's clock, as in clock_getcpuclockid.
        return time.clock_gettime(~pid << 3 | 2)
    return None


def _memory(pid: int) -> int:
    """Sum the anonymous, shared and swapped memory of a process [bytes]; 0 after its end."""
    counted = (b"RssAnon:", b"RssShmem:", b"VmSwap:")
    lines = map(bytes.split, _read(pid, "status").splitlines())
    return sum(1024 * int(words[1]) for words in lines if words and words[0] in counted)


def _read(pid: int, name: str) -> bytes:
    """Read a file that describes a process; nothing after its end."""
    try:
        return Path("/proc", str(pid), name).read_bytes()
    except OSError:
        return b""


def _prctl(option: int, value: int) -> None:
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(option, value, 0, 0, 0)
