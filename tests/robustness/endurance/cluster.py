"""A Dask cluster on the loopback interface, whose workers, machines and scheduler are killed."""

import contextlib
import json
import os
import signal
import socket
import subprocess
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final, NamedTuple, Self

import numpy as np

from solver.instrument.errors import InputError
from solver.instrument.safe_path import PYTHON
from tests.robustness.endurance.runs import (
    children,
    digests,
    finish,
    kill,
    last_message,
    started,
    write_scene,
)
from vbaa_bench.dataset.layout import Layout

_FRAMES, _PER_SHARD, _MACHINES = 24, 2, 2
# Number of the frame at which workers die.
_POISON: Final = 5
_PRELOADED: Final = f"""\
import os, signal
from vbaa_bench.generation.dataset_worker import DatasetWorker

def frame(worker, name, metering, rendered=DatasetWorker.frame):
    if name.number == {_POISON}:
        os.kill(os.getpid(), signal.SIGKILL)
    return rendered(worker, name, metering)

DatasetWorker.frame = frame
"""
EVENTS: Final = ("none", "worker killed", "machine lost", "scheduler restarted", "poison frame")


class ClusterTrial(NamedTuple):
    """One trial: the event, when it came [s], how long the run took [s], and what differs."""

    event: str
    delay_s: float
    seconds: float
    status: int
    different: str
    message: str


@dataclass
class _Cluster:
    """A scheduler and machines, each a nanny with one worker, in processes of their own."""

    folder: Path
    preload: Path | None = None
    port: int = 0
    scheduler: subprocess.Popen[bytes] | None = None
    machines: list[subprocess.Popen[bytes]] = field(default_factory=list)

    def __enter__(self) -> Self:
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self.port = free.getsockname()[1]
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    @property
    def address(self) -> str:
        return f"tcp://127.0.0.1:{self.port}"

    def start(self) -> None:
        """Start the scheduler and all machines."""
        host = ("--host", "127.0.0.1", "--no-dashboard")
        self.scheduler = self._process("dask_scheduler", *host, "--port", str(self.port))
        options = ("--nworkers", "1", "--nthreads", "1", "--memory-limit", "4GB")
        limits = ("--death-timeout", "60", "--local-directory", str(self.folder))
        preload = () if self.preload is None else ("--preload", str(self.preload))
        self.machines = [
            self._process("dask_worker", self.address, *host, *options, *limits, *preload)
            for _ in range(_MACHINES)
        ]

    def stop(self) -> None:
        """Kill everything."""
        for process in (*self.machines, self.scheduler):
            if process is not None:
                with contextlib.suppress(ProcessLookupError):
                    os.killpg(process.pid, signal.SIGKILL)
                process.wait()

    def _process(self, name: str, *options: str) -> subprocess.Popen[bytes]:
        with (self.folder / f"{name}.log").open("ab") as log:
            return subprocess.Popen(
                [*PYTHON, "-m", f"distributed.cli.{name}", *options],
                stdout=log,
                stderr=log,
                start_new_session=True,
            )


def cluster_trials(
    folder: Path, rounds: int, seed: int, progress: Callable[[int, int], None]
) -> list[ClusterTrial]:
    """Run `generate --dask` with each of EVENTS, `rounds` times, in the empty `folder`.

    Every dataset is compared with one of local processes, byte by byte. Raises InputError.
    """
    random = np.random.default_rng(seed)
    folder.mkdir(parents=True, exist_ok=True)
    scene = write_scene(folder / "scene.yaml", _FRAMES, _PER_SHARD)
    finish(scene, folder / "warm", "--workers", "2")  # compiles kernels
    seconds = finish(scene, folder / "local", "--workers", "2")
    reference = digests(folder / "local")
    trials, total = list[ClusterTrial](), rounds * len(EVENTS)
    for number in range(rounds):
        for event in EVENTS:
            delay = float(random.uniform(0.2, 1.0) * seconds)
            out = folder / f"{event.replace(' ', '_')}_{number}"
            trials.append(_trial(scene, out, event, delay, reference))
            progress(len(trials), total)
    return trials


def _trial(
    scene: Path, out: Path, event: str, delay: float, reference: dict[str, str]
) -> ClusterTrial:
    preload = out.with_suffix(".py") if event == "poison frame" else None
    if preload is not None:
        preload.write_text(_PRELOADED, encoding="utf-8")
    start = time.monotonic()
    with _Cluster(scene.parent, preload) as cluster:
        process = started(scene, out, "--dask", cluster.address)
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(delay)
        if event == "worker killed":
            for pid in children(cluster.machines[0].pid):
                kill(pid)
        elif event == "machine lost":
            os.killpg(cluster.machines[0].pid, signal.SIGKILL)
        elif event == "scheduler restarted":
            cluster.stop()
            time.sleep(2)
            cluster.start()
        status = process.wait()
    seconds = time.monotonic() - start
    different = _poisoned(out, reference) if preload else _different(digests(out), reference)
    message = last_message(out.with_name(f"{out.name}.log"))
    return ClusterTrial(event, delay, seconds, status, different, message)


def _different(here: dict[str, str], reference: dict[str, str]) -> str:
    names = sorted(n for n in {*here, *reference} if here.get(n) != reference.get(n))
    return ", ".join(names[:5])


def _poisoned(out: Path, reference: dict[str, str]) -> str:
    """Compare a dataset with a poison frame: its shard alone differs, by this frame alone."""
    layout = Layout(out)
    tables = list(layout.truth.glob("shard_*/failures.json"))
    failures = [name for path in tables for name in json.loads(path.read_bytes())]
    if len(failures) != 1:
        return f"{len(failures)} frames failed"
    (path,), (frame_id,) = tables, failures
    expected = {"hashes.json", "manifest.json", "metadata.csv", "truth.parquet", "failures.json"}
    here = digests(out)
    changed = {n for n in {*here, *reference} if here.get(n) != reference.get(n)}
    shard = path.parent.name
    return ", ".join(
        name
        for name in sorted(changed)
        if Path(name).name not in expected | {f"{frame_id}.png", f"{frame_id}.exr"}
        or ("shard_" in name and shard not in name)
    )


def check_installed() -> None:
    """Raise InputError unless Dask is installed."""
    try:
        import distributed  # noqa: F401
    except ImportError as error:
        raise InputError("endurance cluster needs Dask; install vbaa-bench[cluster]") from error
