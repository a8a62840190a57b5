"""Stand-in for a pool of workers that copies what it should render from an intact dataset."""

import shutil
from collections import deque
from collections.abc import Iterator
from typing import Any

from solver.instrument.files import sha256
from solver.instrument.hashes import HASHES
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.generation.dataset_worker import WrittenShard
from vbaa_bench.generation.metering_record import MeteringRecord
from vbaa_bench.workers.jobs import Ended, Job, Workers


class Restorer(Workers):
    """In the place of a pool of workers: every job copies what it should make from a whole dataset.

    `jobs` are those that were asked for.
    """

    source: Layout
    jobs: list[Job]

    def __init__(self, _count: int, _build: object, arguments: tuple[Any, ...]) -> None:
        self._layout = Layout(arguments[0])

    def outcomes(self, jobs: deque[Job], _done: object) -> Iterator[Ended]:
        for job in jobs:
            if job.method != "meter":
                self.jobs.append(job)
            yield Ended(job, getattr(self, job.method)(*job.arguments))

    def meter(self, _given_up: object) -> MeteringRecord:
        return MeteringRecord.read(self.source.metering)

    def image(self, name: str, _exposure: float) -> str:
        shutil.copy(self.source.observations / name, self._layout.observations / name)
        return sha256(self.source.observations / name)

    def shard(self, number: int, *_: object) -> WrittenShard:
        for tree, source in zip(self._layout.trees, self.source.trees, strict=True):
            target = self._layout.shard(tree, number)
            shutil.rmtree(target, ignore_errors=True)
            shutil.copytree(self.source.shard(source, number), target)
        digests = {
            tree.name: sha256(self.source.shard(tree, number) / HASHES)
            for tree in self.source.trees
        }
        return WrittenShard(digests, 0)
