"""Full disks, read-only file systems, and two commands that write the same folder."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

import numpy as np

from solver.instrument.errors import InputError
from tests.robustness.endurance.runs import digests, finish, last_message, started, write_scene

_FRAMES, _PER_SHARD = 12, 3
# Size of the small file system, relative to the dataset. Chosen: it is full at half of the frames.
_SHARE = 0.5


class DiskTrial(NamedTuple):
    """One trial: what happened, the first command's message, and whether a later one completed.

    `refused` is true if the first command ended with exit status 2 and one message, and `identical`
    if the completed dataset equals one that was never disturbed.
    """

    event: str
    message: str
    refused: bool
    identical: bool


def disk_trials(
    folder: Path, rounds: int, seed: int, progress: Callable[[int, int], None]
) -> list[DiskTrial]:
    """Disturb `generate` `rounds` times in each way, at random times, in the empty `folder`.

    Raises InputError if small file systems cannot be mounted: it needs Linux and root.
    """
    if sys.platform != "linux":
        raise InputError("endurance disk mounts file systems, which needs Linux and root")
    random = np.random.default_rng(seed)
    folder.mkdir(parents=True, exist_ok=True)
    scene = write_scene(folder / "scene.yaml", _FRAMES, _PER_SHARD)
    finish(scene, folder / "warm", "--workers", "2")  # compiles kernels
    seconds = finish(scene, folder / "whole", "--workers", "2")
    reference = digests(folder / "whole")
    size = sum(path.stat().st_size for path in (folder / "whole").rglob("*") if path.is_file())
    trials, total = list[DiskTrial](), 3 * rounds
    for number in range(rounds):
        trials.append(_full(scene, folder / f"full_{number}", reference, int(_SHARE * size)))
        progress(len(trials), total)
        delay = float(random.uniform(0, seconds))
        trials.append(_read_only(scene, folder / f"read_only_{number}", reference, delay))
        progress(len(trials), total)
        delay = float(random.uniform(0, 0.5 * seconds))
        trials.append(_two_writers(scene, folder / f"two_{number}", reference, delay))
        progress(len(trials), total)
    return trials


@contextmanager
def _mounted(folder: Path, size: int) -> Iterator[Path]:
    """Mount a file system of a size [bytes] in memory. Raises InputError."""
    folder.mkdir()
    _mount(f"size={size}", "-t", "tmpfs", "tmpfs", str(folder))
    try:
        yield folder
    finally:
        subprocess.run(["umount", "--lazy", str(folder)], check=False)


def _mount(options: str, *words: str) -> None:
    done = subprocess.run(
        ["mount", "-o", options, *words], capture_output=True, text=True, check=False
    )
    if done.returncode:
        raise InputError(f"no file system can be mounted ({done.stderr.strip()})")


def _full(scene: Path, folder: Path, reference: dict[str, str], size: int) -> DiskTrial:
    with _mounted(folder, size):
        out = folder / "data"
        status = started(scene, out, "--workers", "2", log=folder.with_suffix(".log")).wait()
        message = last_message(folder.with_suffix(".log"))
        _mount("remount,size=100%", str(folder))
        finish(scene, out, "--workers", "2", log=folder.with_suffix(".log"))
        identical = digests(out) == reference
    refused = status == 2 and "No space left" in message
    return DiskTrial("full disk", message.replace(str(folder), ""), refused, identical)


def _read_only(scene: Path, folder: Path, reference: dict[str, str], delay: float) -> DiskTrial:
    """Kill a run, and call it again while its folder is read-only, and afterwards."""
    with _mounted(folder, 10**9):
        out, log = folder / "data", folder.with_suffix(".log")
        process = started(scene, out, "--workers", "2", log=log)
        time.sleep(delay)
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        _mount("remount,ro", str(folder))
        status = started(scene, out, "--workers", "2", log=log).wait()
        message = last_message(log)
        _mount("remount,rw", str(folder))
        finish(scene, out, "--workers", "2", log=log)
        identical = digests(out) == reference
    refused = status == 2 and "Read-only file system" in message
    return DiskTrial("read-only", message.replace(str(folder), ""), refused, identical)


def _two_writers(scene: Path, out: Path, reference: dict[str, str], delay: float) -> DiskTrial:
    logs = [out.with_suffix(f".{number}.log") for number in range(2)]
    first = started(scene, out, "--workers", "1", log=logs[0])
    time.sleep(delay)
    second = started(scene, out, "--workers", "1", log=logs[1])
    statuses = [first.wait(), second.wait()]
    # The one that came later is refused, or finds a complete dataset.
    messages = [last_message(log) for log in logs]
    refused = all(
        status == 0 or (status == 2 and "is being written by process" in message)
        for status, message in zip(statuses, messages, strict=True)
    )
    loser = messages[statuses.index(2)] if 2 in statuses else "both completed, one after the other"
    message = loser.replace(str(out), "").partition(" since ")[0]
    return DiskTrial("two writers", message, refused and 0 in statuses, digests(out) == reference)
