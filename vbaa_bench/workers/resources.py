"""What the machine grants a process: processor cores, and memory."""

import math
import os
import sys
from collections.abc import Iterator
from pathlib import Path, PurePosixPath


def cores() -> int:
    """Count the processor cores that this process may use, by its affinity and its quota."""
    if hasattr(os, "process_cpu_count"):  # from Python 3.13
        count = os.process_cpu_count() or 1
    elif hasattr(os, "sched_getaffinity"):  # not on Windows and macOS
        count = len(os.sched_getaffinity(0))
    else:
        count = os.cpu_count() or 1
    return min(count, quota_cores() or count)


def quota_cores(root: Path = Path("/")) -> int | None:
    """Return a container's quota of processor time: the least of this process's control groups.

    Groups above them count as well. It is rounded up to whole cores. None if there is no quota, or
    no control groups (Linux has them, v1 or v2). `root` is the root of the file system.
    """
    try:
        groups = (root / "proc/self/cgroup").read_text(encoding="utf-8").splitlines()
    except OSError:
        return None
    quotas = list[float]()
    for group in groups:
        _, _, rest = group.partition(":")
        controllers, _, path = rest.partition(":")
        if controllers and "cpu" not in controllers.split(","):
            continue
        names = [controllers, "cpu"] if controllers else ["", "unified"]
        # In a container the path may be that of the host, and its own group the root of the tree.
        inside = PurePosixPath(path.lstrip("/"))
        for name in names:
            for folder in (inside, *inside.parents):
                quotas += _quotas(root / "sys/fs/cgroup" / name / folder)
    return math.ceil(min(quotas)) if quotas else None


def _quotas(group: Path) -> Iterator[float]:
    """Yield the quota that a control group states in its file of v2, or in its two of v1."""
    for files in (("cpu.max",), ("cpu.cfs_quota_us", "cpu.cfs_period_us")):
        try:
            words = [word for name in files for word in (group / name).read_text("utf-8").split()]
            quota, period = map(float, words)
        except (OSError, ValueError):  # no such file, or "max"
            continue
        if quota > 0 and period > 0:  # -1: no quota
            yield quota / period


def memory_mb(pid: int | str, key: str = "VmRSS") -> float:
    """Read an entry of /proc/PID/status [MB]: VmRSS, VmHWM (the peak of VmRSS) or VmData.

    `pid` may be "self". Return 0 if the process has ended, and on other systems.
    """
    try:
        lines = Path(f"/proc/{pid}/status").read_text(encoding="utf-8").splitlines()
    except OSError:
        return 0.0
    sizes = [line.split()[1] for line in lines if line.startswith(f"{key}:")]
    return float(sizes[0]) * 1024 / 1e6 if sizes else 0.0  # the file states KiB


def own_memory_mb() -> float:
    """Measure the resident memory of this process [MB]; its peak on macOS, 0 on Windows."""
    if sys.platform == "win32":
        return 0.0
    import resource  # not on Windows

    return memory_mb("self") or resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6


def peak_memory_bytes() -> int | None:
    """Return the peak memory of this process [bytes], None if it is unknown."""
    if sys.platform == "win32":
        return None
    import resource  # not on Windows

    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else 1024 * peak
