"""Forecast of the cost of a dataset or a collection, from a short probe."""

import contextlib
import math
import os
import tempfile
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Final, NamedTuple

from solver.instrument.errors import InputError
from vbaa_bench.api.data import usable_variant, worker_count
from vbaa_bench.api.scene import AnyScene
from vbaa_bench.assembly.plan import accepted_rig, plan
from vbaa_bench.dataset.collection import CollectionLayout
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.generation.dataset_worker import DatasetWorker
from vbaa_bench.generation.frame_renderer import Metering
from vbaa_bench.generation.generate_collection import RigGenerator
from vbaa_bench.generation.inventory import image_names
from vbaa_bench.scene.frames import FrameName, Frames
from vbaa_bench.scene.load import SceneFile, load_scene
from vbaa_bench.workers.jobs import Job
from vbaa_bench.workers.machine import Machine
from vbaa_bench.workers.pool import GROWTH_MB, Pool
from vbaa_bench.workers.resources import peak_memory_bytes

# Frames that each worker renders, of which the first compiles kernels. Chosen: takes seconds, and
# gives a rough estimate of the variation between frames.
PROBES: Final = 4
# Rigs that each worker makes, of which the first compiles kernels. Chosen: takes half a minute.
PROBED_RIGS: Final = 2
# Time of a probe [s] after which it ends as soon as it is sufficient. From the requirement.
SUFFICIENT_S: Final = 20.0
# Longest time of a probe [s], after which it ends with what has been measured. Chosen: a person
# waits for as long.
LIMIT_S: Final = 180.0
# Longest time [s] of an image in which compilation counts. Chosen: compilation takes less.
_COMPILATION_S: Final = 20.0
# Margin on the time for frames that are not probed and for other workers. Chosen.
_FACTOR: Final = 1.5


@dataclass(frozen=True)
class Forecast:
    """The forecast cost of a dataset on this machine, or of a collection of `rigs` datasets.

    `hours_low` and `hours_high` span the fastest and the slowest probed frame or rig, each widened
    by a factor of 1.5 for those that differ more and for workers that slow each other down. They
    hold for the machine load during the probe, which took `probe_s`. `memory_gb` is that of all
    workers together; None if the system does not report it. Over many rigs each worker may grow
    by GROWTH_MB more.
    """

    rigs: int | None
    frames: int
    pushes: int
    images: int
    workers: int
    hours: float
    hours_low: float
    hours_high: float
    gigabytes: float
    memory_gb: float | None
    probe_s: float

    def record(self) -> dict[str, Any]:
        """Return all fields by name."""
        return asdict(self)

    def __str__(self) -> str:
        memory = "unknown" if self.memory_gb is None else f"{self.memory_gb:.2g} GB"
        rigs = "" if self.rigs is None else f"{self.rigs:,} rigs: "
        growth = "" if self.rigs is None else f", of which each may grow by {GROWTH_MB:g} MB more"
        return (
            f"{rigs}{self.frames:,} frames of {self.pushes:,} pushes, and {self.images:,} images "
            f"of the board and the beam at rest\n"
            f"time:    {_duration(self.hours)} with {self.workers} workers, between "
            f"{_duration(self.hours_low)} and {_duration(self.hours_high)} at the machine load of "
            f"the probe, which took {_duration(self.probe_s / 3600)}\n"
            f"disk:    {_size(self.gigabytes)}, within about 10 %\n"
            f"memory:  {memory} in total, the peak of a probing worker times the number of workers"
            f"{growth}"
        )


def forecast(
    scene: AnyScene, *, workers: int | None = None, variant: str | None = None
) -> Forecast:
    """Forecast frames, time, disk space and memory of a scene's dataset, from a few of its frames.

    These frames are rendered, and their time and size are measured, with the same number of workers
    as for the dataset. After SUFFICIENT_S, one frame in compiled kernels is sufficient, or as many
    rigs as workers; after LIMIT_S, what has been measured. Of a collection, a few whole rigs are
    made, spread over its numbers, or a few frames of the first one if no rig is made in LIMIT_S.
    Pushes that are not probed may still be impossible; `generate` checks more of them before it
    renders, and records the others.

    Raises InputError if a probed push is impossible, and if no frame is rendered in time.
    """
    chosen_variant = usable_variant(variant)
    count = worker_count(workers, chosen_variant)
    file = scene if isinstance(scene, SceneFile) else load_scene(scene)
    if file.rigs is not None:
        return _collection_forecast(file, file.rigs, chosen_variant, count)
    return _dataset_forecast(accepted_rig(file), chosen_variant, count)


def _dataset_forecast(file: SceneFile, chosen_variant: str, count: int) -> Forecast:
    frames = Frames(file.scene)
    start = time.monotonic()
    probe = _probe(file, _spread(frames.count, PROBES * count), chosen_variant, count)
    images = len(image_names(file.scene))

    def hours(frame_s: float) -> float:
        # No worker renders less than one shard.
        rendered = math.ceil(frames.shards / count) / frames.shards * frames.count
        rendering = rendered * frame_s + images * probe.image_s / count
        return (probe.start_s + rendering) / 3600

    mean = sum(probe.frames_s) / len(probe.frames_s)
    return Forecast(
        rigs=None,
        frames=frames.count,
        pushes=frames.pushes,
        images=images,
        workers=count,
        hours=hours(mean),
        hours_low=hours(min(probe.frames_s)) / _FACTOR,
        hours_high=hours(max(probe.frames_s)) * _FACTOR,
        gigabytes=(frames.count * probe.frame_bytes + images * probe.image_bytes) / 1e9,
        memory_gb=None if probe.memory_bytes is None else count * probe.memory_bytes / 1e9,
        probe_s=time.monotonic() - start,
    )


class _ProbedRig(NamedTuple):
    """A rig, why it is impossible, if it is; its time [s], and its worker and memory [bytes]."""

    number: int
    reason: str
    seconds: float
    worker: int
    memory_bytes: int | None


class _TimedRigGenerator(RigGenerator):
    """A RigGenerator that times its rigs."""

    def probe(self, on_progress: Callable[[], None], number: int, root: Path) -> _ProbedRig:
        """Generate a rig's dataset in this process."""
        start = time.perf_counter()
        reason = self.rig(on_progress, number, root, {}).reason
        return _ProbedRig(
            number, reason, time.perf_counter() - start, os.getpid(), peak_memory_bytes()
        )


def _collection_forecast(file: SceneFile, rigs: int, variant: str, workers: int) -> Forecast:
    start, probed = time.monotonic(), list[_ProbedRig]()
    numbers = _spread(rigs, PROBED_RIGS * workers)
    with tempfile.TemporaryDirectory(prefix="vbaa-plan-") as folder:
        layout, threads = CollectionLayout(Path(folder)), Machine(variant, workers).threads_each
        jobs = [("probe", (number, layout.rig(number).root)) for number in numbers]
        with (
            contextlib.suppress(_OutOfTimeError),
            Pool(workers, _TimedRigGenerator, (file, variant, threads)) as pool,
        ):
            probed.extend(_results(pool, jobs, start, lambda: len(probed) >= workers))
        size = sum(path.stat().st_size for path in layout.root.rglob("*") if path.is_file())
    if not probed:
        return _of_one_rig(file, rigs, variant, workers, start)
    for one in probed:
        if one.reason:
            raise InputError(one.reason)
    # The first rig of each worker compiles kernels.
    started, warm = set[int](), list[float]()
    for one in probed:
        if one.worker in started:
            warm.append(one.seconds)
        started.add(one.worker)
    seconds = warm or [one.seconds for one in probed]
    scenes = [accepted_rig(file, one.number).scene for one in probed]
    share = rigs / len(probed)
    counts = [Frames(scene) for scene in scenes]
    images = sum(len(image_names(scene)) for scene in scenes)
    compiling = max(max(one.seconds for one in probed) - min(seconds), 0.0)

    def hours(rig_s: float) -> float:
        return (compiling + math.ceil(rigs / workers) * rig_s) / 3600

    memory = [one.memory_bytes for one in probed if one.memory_bytes is not None]
    return Forecast(
        rigs=rigs,
        frames=round(share * sum(frames.count for frames in counts)),
        pushes=round(share * sum(frames.pushes for frames in counts)),
        images=round(share * images),
        workers=workers,
        hours=hours(sum(seconds) / len(seconds)),
        hours_low=hours(min(seconds)) / _FACTOR,
        hours_high=hours(max(seconds)) * _FACTOR,
        gigabytes=share * size / 1e9,
        memory_gb=max(memory) * workers / 1e9 if memory else None,
        probe_s=time.monotonic() - start,
    )


def _of_one_rig(file: SceneFile, rigs: int, variant: str, workers: int, start: float) -> Forecast:
    """Forecast a collection from frames of its first rig; `start` is that of the probe."""
    one = _dataset_forecast(accepted_rig(file), variant, workers)
    return replace(
        one,
        rigs=rigs,
        **{name: rigs * getattr(one, name) for name in ("frames", "pushes", "images", "gigabytes")},
        **{name: rigs * getattr(one, name) for name in ("hours", "hours_low", "hours_high")},
        probe_s=time.monotonic() - start,
    )


@dataclass(frozen=True)
class _Probe:
    """Measured times [s], sizes [bytes] and peak memory [bytes] of a probe.

    Times are those until a worker has compiled its kernels, of each probed frame with the mechanics
    of its push, and of one calibration image.
    """

    start_s: float
    frames_s: Sequence[float]
    image_s: float
    frame_bytes: float
    image_bytes: float
    memory_bytes: int | None


class _ProbedFrame(NamedTuple):
    """A frame: time [s], in compiled kernels or not, size and peak memory [bytes]."""

    seconds: float
    is_warm: bool
    size: int
    memory_bytes: int | None


class _ProbedWorker(DatasetWorker):
    """A DatasetWorker that times its frames."""

    _is_warm = False

    def probe(
        self, on_progress: Callable[[], None], number: int, name: FrameName, metering: Metering
    ) -> _ProbedFrame:
        """Render a shard of one frame."""
        start = time.perf_counter()
        self.shard(on_progress, number, [name], metering, {})
        seconds = time.perf_counter() - start
        is_warm, self._is_warm = self._is_warm or seconds > _COMPILATION_S, True
        shards = [self.layout.shard(tree, number) for tree in self.layout.trees]
        size = sum(path.stat().st_size for shard in shards for path in shard.iterdir())
        return _ProbedFrame(seconds, is_warm, size, peak_memory_bytes())


class _OutOfTimeError(Exception):
    """The time of a probe is over."""


def _results(
    pool: Pool,
    jobs: Iterable[tuple[str, tuple[Any, ...]]],
    start: float,
    is_sufficient: Callable[[], bool] = lambda: False,
) -> Iterator[Any]:
    """Run jobs of a probe, which began at `start`; yield the result of each when it has ended.

    Raises _OutOfTimeError when the probe is over, which ends the workers, and what the pool raises.
    """

    def check(_pieces: int) -> None:
        elapsed = time.monotonic() - start
        if elapsed > LIMIT_S or (elapsed > SUFFICIENT_S and is_sufficient()):
            raise _OutOfTimeError

    for ended in pool.outcomes(deque(Job(*job) for job in jobs), check):
        if ended.death is not None:
            raise ended.death
        yield ended.result


def _spread(frames: int, max_count: int) -> list[int]:
    """Choose indices of frames evenly spread over a scene."""
    count = min(max_count, frames)
    return [(2 * i + 1) * frames // (2 * count) for i in range(count)]


def _probe(file: SceneFile, indices: Sequence[int], variant: str, workers: int) -> _Probe:
    """Render frames and a calibration image. Raises InputError if no frame is rendered in time."""
    start, push_of = time.monotonic(), Frames(file.scene).push_of
    specs = plan(file, pushes={push_of(index) for index in indices}).frame_specs
    names = {spec.index: FrameName(spec.frame_id, spec.index) for spec in specs}
    # Twice as many as workers at least, so that frames are rendered after the kernels are compiled.
    probes = [indices[n % len(indices)] for n in range(max(len(indices), 2 * workers))]
    frames, image_s = list[_ProbedFrame](), 0.0
    with tempfile.TemporaryDirectory(prefix="vbaa-plan-") as folder:
        layout, view = Layout(Path(folder)), "calibration/view_00.png"
        (layout.observations / view).parent.mkdir(parents=True)
        layout.truth.mkdir()
        threads = Machine(variant, workers).threads_each
        with (
            contextlib.suppress(_OutOfTimeError),
            Pool(workers, _ProbedWorker, (file, layout, variant, threads)) as pool,
        ):
            (record,) = _results(pool, [("meter", ({},))], start)
            metering: Metering = record.metering
            for _ in range(2):  # the first one compiles
                began = time.monotonic()
                list(_results(pool, [("image", (view, metering.exposure))], start))
                image_s = time.monotonic() - began
                if time.monotonic() - start > SUFFICIENT_S:
                    break
            metered_s = time.monotonic() - start
            jobs = [("probe", (n, names[index], metering)) for n, index in enumerate(probes)]
            frames.extend(_results(pool, jobs, start, lambda: any(one.is_warm for one in frames)))
        if not frames:
            raise InputError(
                f"{file.path}: no frame is rendered in the {LIMIT_S:g} s of a probe, so that no "
                "time can be forecast; smaller images or larger noise targets take less"
            )
        image_bytes = (layout.observations / view).stat().st_size
    memory = [frame.memory_bytes for frame in frames if frame.memory_bytes is not None]
    warm = [frame.seconds for frame in frames if frame.is_warm]
    cold = [frame.seconds for frame in frames if not frame.is_warm]
    return _Probe(
        start_s=metered_s + max(cold, default=0.0),
        frames_s=warm or cold,
        image_s=image_s,
        frame_bytes=sum(frame.size for frame in frames) / len(frames),
        image_bytes=image_bytes,
        memory_bytes=max(memory, default=None),
    )


def _duration(hours: float) -> str:
    if hours < 1 / 60:
        return f"{3600 * hours:.2g} s"
    return f"{60 * hours:.2g} min" if hours < 1 else f"{hours:.3g} h"


def _size(gigabytes: float) -> str:
    return f"{1e3 * gigabytes:.2g} MB" if gigabytes < 1 else f"{gigabytes:.3g} GB"
