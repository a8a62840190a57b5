"""Resident memory of processes."""

import sys
from pathlib import Path


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
