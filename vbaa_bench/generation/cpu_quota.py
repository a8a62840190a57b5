"""Quota of processor time of a container, in processor cores: Linux's control groups, v1 and v2."""

import math
from collections.abc import Iterator
from pathlib import Path, PurePosixPath


def quota_cores(root: Path = Path("/")) -> int | None:
    """Return the least quota of this process's control groups and of those above them, rounded up.

    None if there is no quota, or no control groups. `root` is the root of the file system.
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
