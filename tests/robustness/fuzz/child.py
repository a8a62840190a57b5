"""The child process: run cases one by one, and measure each.

The time limit is enforced within the process, so that the place of a hang is known. Memory is the
peak of the resident set, which Linux resets on request. The address space cannot be limited, since
compilers and renderers map far more than they use; the data segment is limited, far above the
memory limit, so that a case that needs more ends itself and not the machine.
"""

import faulthandler
import gc
import os
import random
import re
import resource
import shutil
import sys
import tempfile
import time
import traceback
import warnings
from collections.abc import Mapping
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Final

import cv2

from tests.robustness.fuzz.case import (
    CLOCK_LIMIT_S,
    MEMORY_LIMIT_MB,
    TIME_LIMIT_S,
    Case,
    Kind,
    KindFactory,
    Result,
    verdict,
)
from tests.robustness.fuzz.watch import Watch, changes, listing
from vbaa_bench.workers.resources import memory_mb

# Data segment [bytes] beyond that of an idle process; twice the allowed memory.
_DATA_SEGMENT: Final = int(2 * MEMORY_LIMIT_MB * 1e6)
# Chosen: enough for the innermost frames of a traceback.
_MAX_TEXT: Final = 6000
# Lines that image libraries print by themselves, about a file that they refuse or repair.
_LIBRARIES: Final = re.compile(r"(libpng|Corrupt JPEG|Premature end of JPEG|.*EXR|Warning: Exc)")


def run_cases(
    pipe: Connection, factories: Mapping[str, KindFactory], seed: int, material: Path, work: Path
) -> None:
    """Receive cases from `pipe` and send their results, until None is received.

    `material` holds valid inputs and `work` is this process's own folder. In it, `case` holds the
    input of the current case, and `output` what compiled code printed.
    """
    runner = Runner(factories, seed, material, work)
    _limit_data_segment()
    pipe.send("ready")
    while (case := pipe.recv()) is not None:
        pipe.send(runner.run(Case(*case)))


class Runner:
    """Runs cases in this process, and watches what they do outside of their folder."""

    def __init__(
        self, factories: Mapping[str, KindFactory], seed: int, material: Path, work: Path
    ) -> None:
        cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)  # as the commands do
        self._seed, self._material, self._work = seed, material, work
        self.folder, self._outside = work / "case", work / "outside"
        for path in (self.folder, self._outside):
            path.mkdir(parents=True, exist_ok=True)
        for name in ("secret.stl", "secret.png", "secret.exr", "secret.csv", "secret.json"):
            (self._outside / name).write_text("not for scenes\n", encoding="utf-8")
        self._kinds: dict[str, Kind] = {
            name: factory(material) for name, factory in factories.items()
        }
        self._watch = Watch((material,))
        self._before = listing(self._outside, material)

    def run(self, case: Case) -> Result:
        """Run one case; the files that it wrote remain in `folder` until the next."""
        shutil.rmtree(self.folder)
        self.folder.mkdir()
        chance = random.Random(f"{self._seed} {case.kind} {case.number}")
        tempfile.tempdir = str(self.folder)
        os.chdir(self.folder)
        reset_peak_memory()
        start = time.process_time()
        faulthandler.dump_traceback_later(CLOCK_LIMIT_S, exit=True, file=2)
        try:
            with (
                warnings.catch_warnings(record=True) as caught,
                _Captured(self._work / "output") as captured,
                self._watch.confined(self.folder) as events,
            ):
                warnings.simplefilter("always")
                outcome, text = verdict(
                    lambda: self._kinds[case.kind].attempt(chance, self.folder),
                    self.folder,
                    self._material,
                )
        except MemoryError:
            outcome, text = "memory", _short(traceback.format_exc())
        except BaseException:  # noqa: BLE001  # whatever it is, it is a finding
            outcome, text = "traceback", _short(traceback.format_exc())
        finally:
            faulthandler.cancel_dump_traceback_later()
        seconds, memory = time.process_time() - start, peak_memory_mb()
        if outcome in {"accepted", "refused"}:
            outside = [*events, *changes(self._before, listing(self._outside, self._material))]
            printed = [*(str(warning.message) for warning in caught), captured.text]
            if memory > MEMORY_LIMIT_MB:
                outcome, text = "memory", f"{memory:.0f} MB; {text}"
            elif seconds > TIME_LIMIT_S:
                outcome, text = "hang", f"{seconds:.0f} s; {text}"
            elif outside:
                outcome, text = "outside", "\n".join(outside[:20])
            elif any(printed):
                outcome = "printed" if caught or not _LIBRARIES.match(captured.text) else "noisy"
                text = _short("\n".join(filter(None, [*printed, text])))
        if memory > MEMORY_LIMIT_MB / 4:
            gc.collect()
        return Result(outcome, seconds, memory, text)


class _Captured:
    """Redirects the file descriptors 1 and 2 to a file, also for compiled code."""

    def __init__(self, path: Path) -> None:
        self._path, self.text = path, ""

    def __enter__(self) -> "_Captured":
        self._file = os.open(self._path, os.O_RDWR | os.O_CREAT | os.O_TRUNC)
        self._saved = os.dup(1), os.dup(2)
        for descriptor in (1, 2):
            os.dup2(self._file, descriptor)
        return self

    def __exit__(self, *_: object) -> None:
        for stream in (sys.stdout, sys.stderr):
            stream.flush()
        for descriptor, saved in zip((1, 2), self._saved, strict=True):
            os.dup2(saved, descriptor)
            os.close(saved)
        self.text = os.pread(self._file, 100_000, 0).decode(errors="replace").strip()
        os.close(self._file)


def _short(text: str) -> str:
    """Keep the end of a long text: the innermost frames and the error."""
    return text if len(text) <= _MAX_TEXT else f"...{text[-_MAX_TEXT:]}"


def _limit_data_segment() -> None:
    if used_mb := memory_mb("self", "VmData"):
        resource.setrlimit(resource.RLIMIT_DATA, (int(used_mb * 1e6) + _DATA_SEGMENT,) * 2)


def reset_peak_memory() -> None:
    """Begin to record the peak of this process's resident memory; on Linux."""
    clear = Path("/proc/self/clear_refs")
    if clear.exists():
        clear.write_text("5", encoding="ascii")


def peak_memory_mb() -> float:
    """Return the peak of this process's resident memory since it was reset."""
    return memory_mb("self", "VmHWM") or resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
