"""Generation of the files that a dataset lacks, by workers that may die."""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

from vbaa_bench.dataset.layout import Layout, shard_hashes, shard_name
from vbaa_bench.generation.dataset_worker import WrittenShard, image_job
from vbaa_bench.generation.deaths import Deaths
from vbaa_bench.generation.frame_renderer import Metering
from vbaa_bench.generation.inventory import Contents, Inventory
from vbaa_bench.generation.metering_record import MeteringRecord, write_metering
from vbaa_bench.workers.jobs import Job, WorkerDiedError, Workers


@dataclass
class MissingFiles:
    """The images and shards of a dataset that are not intact.

    `inventory` gets the hashes of the generated files. Frames in `deaths` are not rendered.
    """

    layout: Layout
    contents: Contents
    inventory: Inventory
    deaths: Deaths

    @property
    def images(self) -> list[str]:
        """Names of the missing board views and rest images."""
        intact = self.inventory.whole["observations"]
        return [name for name in self.contents.images if name not in intact]

    @property
    def shards(self) -> list[int]:
        """Numbers of the missing shards."""
        intact = self.inventory.whole["observations"]
        return [number for number in self.contents.shards if shard_hashes(number) not in intact]

    def generate(
        self,
        workers: Workers,
        progress: Callable[[int, int], None],
        record: MeteringRecord | None = None,
    ) -> Metering:
        """Generate all of them; return the metering, which is measured if there is no record.

        Raises what the workers raise, ImageError if processes die at an image without which there
        is no dataset, and WorkerDiedError if they die for other reasons than single images.
        """
        images, numbers, shards = self.images, self.shards, self.contents.shards
        # One more than the number of images: the exposure is metered on an image that is not kept.
        total = sum(map(len, shards.values())) + len(self.contents.images) + 1
        missing = sum(len(shards[n]) for n in numbers) + len(images)
        progress(total - missing - 1, total)
        if record is None:
            record = self._metered(workers)
            write_metering(self.layout, record)
        self.deaths.given_up |= record.failed
        metering = record.metering
        jobs = deque(Job("image", (name, metering.exposure)) for name in images)
        jobs.extend(self._shard_job(number, metering) for number in numbers)
        done_before = total - missing
        for ended in workers.survived(
            jobs, lambda done: progress(done_before + done, total), self._again
        ):
            name = ended.job.arguments[0]
            if ended.job.method == "image":
                self.inventory.whole["observations"][name] = ended.result
            else:
                self._record(name, ended.result)
        return metering

    def _metered(self, workers: Workers) -> MeteringRecord:
        (ended,) = workers.survived(deque([self._meter_job()]), lambda _done: None, self._again)
        record: MeteringRecord = ended.result
        return record

    def _again(self, job: Job, death: WorkerDiedError) -> Job:
        """Record that the process of a job has died; return the job without what it died of."""
        if job.method == "meter":
            self.deaths.record(self.layout, "meter", death)
            return self._meter_job()
        if job.method == "image":
            self.deaths.record(self.layout, image_job(job.arguments[0]), death)
            return job
        number, _, metering, _ = job.arguments
        self.deaths.record(self.layout, shard_name(number), death)
        return self._shard_job(number, metering)

    def _meter_job(self) -> Job:
        return Job("meter", (dict(self.deaths.given_up),))

    def _shard_job(self, number: int, metering: Metering) -> Job:
        frames = self.contents.shards[number]
        given_up = {
            name.frame_id: self.deaths.given_up[name.frame_id]
            for name in frames
            if name.frame_id in self.deaths.given_up
        }
        return Job("shard", (number, frames, metering, given_up))

    def _record(self, number: int, written: WrittenShard) -> None:
        self.inventory.failed[number] = written.failed
        for tree, value in written.digests.items():
            self.inventory.whole[tree][shard_hashes(number)] = value
