"""Choice of workers: processes of this machine, of a cluster, or this process itself."""

from collections.abc import Callable
from typing import Any, NamedTuple

from vbaa_bench.workers.cluster import ClusterAddress, ClusterPool
from vbaa_bench.workers.jobs import SameProcess, Workers
from vbaa_bench.workers.pool import Pool
from vbaa_bench.workers.resources import cores


class Machine(NamedTuple):
    """Mitsuba's variant, the number of worker processes, 0 for none, and of their threads.

    With the address of a `cluster`, its workers take the place of processes of this machine.
    """

    variant: str
    workers: int
    threads: int | None = None
    cluster: ClusterAddress | None = None

    def pool(
        self, build: Callable[..., Any], arguments: tuple[Any, ...], remark: Callable[[str], None]
    ) -> Workers:
        """Return the processes, each of which builds an object."""
        if self.cluster is not None:
            return ClusterPool(self.cluster, build, arguments, remark)
        return (Pool if self.workers else SameProcess)(self.workers, build, arguments)

    @property
    def threads_each(self) -> int:
        """Number of threads of each process; those of a cluster have one."""
        if self.cluster is not None:
            return 1
        return self.threads or max(cores() // max(self.workers, 1), 1)
