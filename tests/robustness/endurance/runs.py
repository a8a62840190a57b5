"""Runs of the command `generate` in processes of their own, on a small scene."""

import hashlib
import os
import signal
import subprocess
import time
from pathlib import Path
from typing import Final

from solver.instrument.errors import InputError
from solver.instrument.safe_path import PYTHON

# Chosen: images as small as the calibration of a rig allows, so that a run takes seconds.
_SCENE: Final = """\
title: Small images for tests of endurance
seed: {seed}
camera: {{width_px: 96, height_px: 32, focal_length_px: 130, position_mm: [120, 14, 360],
         look_at_mm: [120, 14, 0]}}
calibration: {{columns: 20, rows: 5, square_mm: 10, center_mm: [120, 20], views: 3}}
sensor: {{rest_images: 1}}
sampling: {{method: sobol, count: {frames}, contact_distance_mm: [60, 200],
           deflection_pct: [3, 6]}}
frames_per_shard: {per_shard}
"""


def write_scene(path: Path, frames: int, per_shard: int, seed: int = 1) -> Path:
    """Write a scene with this many frames; return its path."""
    path.write_text(_SCENE.format(frames=frames, per_shard=per_shard, seed=seed), encoding="utf-8")
    return path


def started(
    scene: Path, out: Path, *options: str, log: Path | None = None
) -> subprocess.Popen[str]:
    """Start `generate` in a session of its own; messages go to `log`, by default beside `out`."""
    command = [*PYTHON, "-m", "vbaa_bench", "generate", str(scene), "--out", str(out)]
    with _log(out, log).open("a", encoding="utf-8") as messages:
        return subprocess.Popen(
            [*command, *options],
            stdout=subprocess.DEVNULL,
            stderr=messages,
            text=True,
            start_new_session=True,
        )


def finish(scene: Path, out: Path, *options: str, log: Path | None = None) -> float:
    """Run `generate` to its end; return its seconds. Raises InputError if it fails."""
    start = time.monotonic()
    if started(scene, out, *options, log=log).wait():
        raise InputError(f"{out}: generate failed: {last_message(_log(out, log))}")
    return time.monotonic() - start


def _log(out: Path, log: Path | None) -> Path:
    return log or out.with_name(f"{out.name}.log")


def last_message(log: Path) -> str:
    """Return the last message in a file, which may have progress bars; empty if there is none."""
    lines = log.read_text(encoding="utf-8").splitlines()
    messages = [line for line in lines if line.strip() and "━" not in line]
    return messages[-1] if messages else ""


def digests(root: Path) -> dict[str, str]:
    """Compute the sha256 of every file below a folder, by name."""
    return {
        path.relative_to(root).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(root.rglob("*"))
        if path.is_file()
    }


def children(pid: int) -> list[int]:
    """List the child processes of a process, as Linux records them; empty elsewhere."""
    try:
        names = Path(f"/proc/{pid}/task/{pid}/children").read_text(encoding="ascii").split()
    except OSError:
        return []
    return [int(name) for name in names]


def is_worker(pid: int) -> bool:
    """Test whether a process was started by multiprocessing to work, not to track resources."""
    try:
        command = Path(f"/proc/{pid}/cmdline").read_bytes().split(b"\0")
    except OSError:
        return False
    return b"--multiprocessing-fork" in command


def is_running(pid: int) -> bool:
    """Test whether a process runs; one that has ended and was not waited for does not."""
    try:
        state = Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rpartition(")")[2].split()[0]
    except OSError:
        return False
    return state not in "ZX"


def kill(pid: int) -> bool:
    """Kill a process; return whether it was there."""
    try:
        os.kill(pid, signal.SIGKILL)
    except ProcessLookupError:
        return False
    return True
