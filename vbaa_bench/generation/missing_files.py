"""Generation of the files that a dataset lacks, by workers that may die."""

from collections import Counter, deque
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, Protocol

from solver.instrument.hashes import HASHES
from vbaa_bench.dataset.inventory import Contents, Inventory
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.dataset.writer import interrupted_frames
from vbaa_bench.generation.dataset_worker import WrittenShard
from vbaa_bench.generation.frame_renderer import Metering
from vbaa_bench.generation.workers import Ended, Job
from vbaa_bench.scene.frames import FrameName

# Deaths of processes that rendered the same frame, after which the frame is given up. Chosen: a
# single death has other reasons, such as a lack of memory or a person who ends the process.
FATAL: Final = 2
# Reason of such a failure.
DIED: Final = "the process that rendered it died"
# Deaths during one job, beyond those of frames that are given up, after which the command ends.
# Chosen: they are due to the machine.
MAX_DEATHS: Final = 5


class Workers(Protocol):
    """Processes that run jobs; see Pool."""

    def outcomes(self, jobs: deque[Job], done: Callable[[int], None]) -> Iterator[Ended]:
        """Run jobs, to which more may be added meanwhile, and yield each when it has ended."""


@dataclass
class MissingFiles:
    """The images and shards of a dataset that are not intact.

    `inventory` gets the hashes of the generated files. `died` has the reasons of frames that are
    given up because their processes died.
    """

    layout: Layout
    contents: Contents
    shards: Mapping[int, tuple[FrameName, ...]]
    inventory: Inventory
    died: dict[str, str]
    _deaths: Counter[Any] = field(default_factory=Counter)

    def generate(self, workers: Workers, progress: Callable[[int, int], None]) -> Metering:
        """Generate all of them; return what was measured first.

        Raises what the workers raise, and WorkerDiedError if processes die for other reasons than
        single frames.
        """
        observations = self.inventory.whole["observations"]
        images = [name for name in self.contents.images if name not in observations]
        numbers = [n for n in self.shards if shard_name(n) not in observations]
        # One more than the number of images: the exposure is metered on an image that is not kept.
        total = sum(map(len, self.shards.values())) + len(self.contents.images) + 1
        missing = sum(len(self.shards[n]) for n in numbers) + len(images)
        progress(total - missing - 1, total)
        metering = self._metering(workers)
        jobs = deque(Job("image", (name, metering.exposure)) for name in images)
        jobs.extend(Job("shard", (n, self.shards[n], metering, dict(self.died))) for n in numbers)
        for ended in workers.outcomes(jobs, lambda done: progress(total - missing + done, total)):
            if ended.death is not None:
                jobs.append(self._again(ended))
            elif ended.job.method == "image":
                observations[ended.job.arguments[0]] = ended.result
            else:
                self._record(ended.job.arguments[0], ended.result)
        return metering

    def _metering(self, workers: Workers) -> Metering:
        jobs = deque([Job("meter", (True,))])
        for ended in workers.outcomes(jobs, lambda _done: None):
            if ended.death is None:
                metering: Metering = ended.result
            else:
                again = self._again(ended)
                # One of its frames may be the reason; these may then not be rendered here.
                jobs.append(again._replace(arguments=(self._deaths["meter"] < MAX_DEATHS,)))
        return metering

    def _again(self, ended: Ended) -> Job:
        """Return the job of a process that died, without the frames that are given up."""
        job, number = ended.job, ended.job.arguments[0]
        if job.method == "shard":
            for frame_id, deaths in interrupted_frames(self.layout, number).items():
                if deaths >= FATAL and frame_id not in self.died:
                    self.died[frame_id] = DIED
                    self._deaths[number] -= FATAL
            job = job._replace(arguments=(*job.arguments[:-1], dict(self.died)))
        key = "meter" if job.method == "meter" else number
        self._deaths[key] += 1
        if self._deaths[key] > MAX_DEATHS:
            assert ended.death is not None
            raise ended.death
        return job

    def _record(self, number: int, written: WrittenShard) -> None:
        self.inventory.failed[number] = written.failed
        for tree, value in written.digests.items():
            self.inventory.whole[tree][shard_name(number)] = value


def shard_name(number: int) -> str:
    """Name the hashes.json of a shard in the hashes.json of its tree."""
    return Layout(Path()).shard(Path(), number).joinpath(HASHES).as_posix()
