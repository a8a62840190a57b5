"""Rate and memory of a long run of frames or rigs, sampled while it renders."""

import time
from collections.abc import Callable
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from solver.instrument.errors import InputError
from tests.robustness.endurance.runs import children, last_message, started, write_scene
from vbaa_bench.workers.resources import memory_mb

_PER_SHARD: Final = 50
# Seconds between samples. Chosen: hundreds of samples of a run of an hour.
_INTERVAL_S: Final = 5.0
# Rigs that differ in what they are made of, so that each has kernels of its own. Chosen: images as
# small as the calibration of a rig allows.
_RIGS: Final = """\
title: Small random rigs for tests of endurance
seed: 1
rigs: {rigs}
beam: {{paint: {{choice: [gloss, bare, matt, black]}}}}
camera:
  width_px: 96
  height_px: 32
  focal_length_px: 130
  position_mm: [120, 14, 360]
  look_at_mm: [120, 14, 0]
  distortion: {{choice: [[], [-0.05, 0.0, 0.0, 0.0, 0.0]]}}
optics: {{point_spread_px: {{choice: [0.0, 0.5]}}}}
lights:
  choice:
  - [{{kind: area, position_mm: [120, -250, 420]}}]
  - [{{kind: side}}]
  - [{{kind: ring}}]
  - [{{kind: area, position_mm: [120, -250, 420]}}, {{kind: side}}]
background: {{pattern: {{choice: [plain, textured, graded]}}}}
object:
  choice:
  - {{kind: peg, paint: {{choice: [matt, gloss, bare]}}}}
  - {{kind: block}}
calibration: {{columns: 20, rows: 5, square_mm: 10, center_mm: [120, 20], views: 3}}
sensor: {{rest_images: 1}}
render: {{sample_table: false}}
pushes: {{contact_distance_mm: [80, 180], deflection_pct: [4]}}
"""
# Share of the run that starts workers and compiles kernels, and is left out. Chosen.
_START: Final = 0.05


class Sample(NamedTuple):
    """Time [s], finished frames or rigs, and memory of all processes and of the parent [MB]."""

    seconds: float
    finished: int
    memory_mb: float
    parent_mb: float


class LongRun(NamedTuple):
    """Frames or rigs, hours, and first and last tenth of a run: rates [1/s] and memory [MB]."""

    finished: int
    hours: float
    first_rate: float
    last_rate: float
    first_mb: float
    last_mb: float
    first_parent_mb: float
    last_parent_mb: float


def long_run(
    folder: Path, frames: int, workers: int, progress: Callable[[int, int], None]
) -> LongRun:
    """Generate a dataset of small images in the empty `folder`, and sample it while it runs.

    Raises InputError if it fails, or on a system without /proc.
    """
    folder.mkdir(parents=True, exist_ok=True)
    scene = write_scene(folder / "scene.yaml", frames, _PER_SHARD)
    shards = "observations/shard_*"
    return _sampled(scene, frames, (shards, _PER_SHARD), workers, progress)


def many_rigs(
    folder: Path, rigs: int, workers: int, progress: Callable[[int, int], None]
) -> LongRun:
    """Generate a collection of small rigs in the empty `folder`, and sample it while it runs.

    Raises InputError if it fails, or on a system without /proc.
    """
    folder.mkdir(parents=True, exist_ok=True)
    scene = folder / "scene.yaml"
    scene.write_text(_RIGS.format(rigs=rigs), encoding="utf-8")
    return _sampled(scene, rigs, ("rig_*/observations/hashes.json", 1), workers, progress)


def _sampled(
    scene: Path,
    total: int,
    finished: tuple[str, int],
    workers: int,
    progress: Callable[[int, int], None],
) -> LongRun:
    """Generate `total` frames or rigs beside a scene; `finished` paths stand for a number each."""
    if not Path("/proc").is_dir():
        raise InputError("endurance reads /proc, which this system does not have")
    out, (pattern, each) = scene.with_name("data"), finished
    start, samples = time.monotonic(), list[Sample]()
    process = started(scene, out, "--workers", str(workers))
    while process.poll() is None:
        count = each * len(list(out.glob(pattern)))
        parent = memory_mb(process.pid)
        memory = parent + sum(map(memory_mb, children(process.pid)))
        samples.append(Sample(time.monotonic() - start, count, memory, parent))
        progress(count, total)
        time.sleep(_INTERVAL_S)
    if process.returncode:
        raise InputError(f"{out}: generate failed: {last_message(scene.with_name('data.log'))}")
    return summary(samples, total)


def summary(samples: list[Sample], total: int) -> LongRun:
    """Compare the first and the last tenth of the samples, after the start.

    Raises InputError if there are too few samples.
    """
    rendering = [one for one in samples if _START * total < one.finished < total]
    table = np.array(rendering).reshape(-1, len(Sample._fields))
    tenth = len(table) // 10
    if tenth < 2:
        raise InputError(
            f"{len(samples)} samples are too few, allowed are runs that take more than "
            f"{20 * _INTERVAL_S:g} s"
        )
    first, last = table[:tenth], table[-tenth:]

    def rate(part: np.ndarray) -> float:
        return float((part[-1, 1] - part[0, 1]) / (part[-1, 0] - part[0, 0]))

    memory = [float(np.median(part[:, column])) for column in (2, 3) for part in (first, last)]
    hours = samples[-1].seconds / 3600
    return LongRun(total, hours, rate(first), rate(last), *memory)
