"""Kill running `generate` commands at random times, and compare what the next call completes."""

import contextlib
import os
import shutil
import signal
import subprocess
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final, Literal

import numpy as np

from solver.instrument.errors import InputError
from tests.robustness.endurance.runs import (
    children,
    digests,
    finish,
    is_running,
    is_worker,
    kill,
    started,
    write_scene,
)

Victim = Literal["worker", "other child", "parent", "tree"]
# A worker process; a child that tests the renderer or tracks resources; the command's own process,
# whose workers must then end; all of them.
VICTIMS: Final[tuple[Victim, ...]] = ("worker", "other child", "parent", "tree")
_FRAMES: Final = 12
_PER_SHARD: Final = 3
# Kills come until this multiple of an uninterrupted run's time. Chosen: some come after its end.
_SPAN: Final = 1.1
# Seconds after which orphaned workers must have ended. Chosen.
_ORPHANS_S: Final = 20.0


@dataclass
class Kills:
    """Counts of kills by victim, and of what they left.

    `too_late` kills came after the end of the run. `completed` datasets were compared with one that
    was never interrupted: `different` lists those that differ, `unfinished` the runs that failed
    although only a child died, and `orphans` counts children that outlived their parent.
    """

    seconds_uninterrupted: float = 0.0
    kills: Counter[Victim] = field(default_factory=Counter)
    too_late: int = 0
    completed: int = 0
    resumed: int = 0
    orphans: int = 0
    different: list[str] = field(default_factory=list)
    unfinished: list[str] = field(default_factory=list)


def kill_runs(rounds: int, seed: int, folder: Path, progress: Callable[[int, int], None]) -> Kills:
    """Kill `generate` `rounds` times, each at a random time, in the empty `folder`.

    A dataset is resumed, and its next run killed again, until a run survives. Raises InputError if
    the uninterrupted run fails.
    """
    if not Path("/proc").is_dir():
        raise InputError("check-kills finds processes in /proc, which this system does not have")
    folder.mkdir(parents=True, exist_ok=True)
    random, kills = np.random.default_rng(seed), Kills()
    scene = write_scene(folder / "scene.yaml", _FRAMES, _PER_SHARD)
    finish(scene, folder / "warm", "--workers", "2")  # compiles kernels
    whole = folder / "whole"
    kills.seconds_uninterrupted = finish(scene, whole, "--workers", "2")
    reference = digests(whole)
    number = 0
    while kills.kills.total() < rounds:
        out = folder / f"killed_{number:03d}"
        number += 1
        attempts = 0
        while not _survives(scene, out, random, kills, rounds):
            attempts += 1
            progress(kills.kills.total(), rounds)
        kills.resumed += attempts > 0
        kills.completed += 1
        here = digests(out)
        if here != reference:
            names = [n for n in {*here, *reference} if here.get(n) != reference.get(n)]
            kills.different.append(f"{out.name}: {', '.join(sorted(names)[:5])}")
        else:
            shutil.rmtree(out)
        progress(kills.kills.total(), rounds)
    return kills


def _survives(
    scene: Path, out: Path, random: np.random.Generator, kills: Kills, rounds: int
) -> bool:
    """Run `generate` and kill a part of it; return whether the dataset is complete."""
    victim = VICTIMS[random.integers(len(VICTIMS))]
    delay = float(random.uniform(0, _SPAN * kills.seconds_uninterrupted))
    with started(scene, out, "--workers", "2") as process:
        if kills.kills.total() >= rounds:
            return process.wait() == 0
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(timeout=delay)
        if process.poll() is not None:
            kills.too_late += 1
            return process.returncode == 0
        descendants = children(process.pid)
        workers = [pid for pid in descendants if is_worker(pid)]
        others = [pid for pid in descendants if pid not in workers]
        group = {"worker": workers, "other child": others}.get(victim)
        if group is not None:
            if not group or not kill(group[random.integers(len(group))]):
                os.killpg(process.pid, signal.SIGKILL)  # no such child now: everything
                victim = "tree"
        elif victim == "parent":
            kill(process.pid)
        else:
            os.killpg(process.pid, signal.SIGKILL)
        kills.kills[victim] += 1
        status = process.wait()
    if victim in ("worker", "other child"):
        if status:
            kills.unfinished.append(f"{out.name}, {victim} killed: status {status}")
        return status == 0
    end = time.monotonic() + _ORPHANS_S
    while any(map(is_running, descendants)) and time.monotonic() < end:
        time.sleep(0.1)
    kills.orphans += sum(map(is_running, descendants))
    return False
