"""Trials: damage one file of a dataset, verify it, run every command, restore it."""

import json
import os
import shutil
import sys
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from solver.instrument.errors import InputError
from solver.instrument.files import write_text
from solver.instrument.hashes import HASHES, digest, read_bytes
from solver.methods import METHODS
from tests.robustness.damage.damages import DAMAGES, kind_of
from tests.robustness.damage.readers import READERS
from vbaa_bench.dataset.faults import Fault
from vbaa_bench.dataset.verify import Counts, faults
from vbaa_bench.workers.pool import Pool

# Outcomes of a command: it reports the damage by an InputError, gives the same bytes as before,
# gives other bytes without a message, or ends with another error.
REFUSED, SAME, SILENT, CRASHED = "refused", "same bytes", "silent", "crashed"
OUTCOMES: Final = (REFUSED, SAME, SILENT, CRASHED)
# Folders that commands write into.
_WRITTEN: Final = ("predictions", "report", "scores")
# Trials of one job. Chosen: a job takes seconds.
_PER_JOB: Final = 10
_FINISHED: Final = "trials.jsonl"
# Damages that leave all names as they are.
_SAME_NAMES: Final = {"flip", "truncate"}


class Trial(NamedTuple):
    """A damaged file, its kind, the damage, whether `verify` names it, outcomes of commands."""

    number: int
    name: str
    kind: str
    damage: str
    named: bool
    outcomes: dict[str, str]


def run_trials(
    dataset: Path,
    work: Path,
    count: int,
    seed: int,
    workers: int,
    progress: Callable[[int, int], None],
) -> list[Trial]:
    """Damage files of a finished dataset, one at a time, on copies in the folder `work`.

    Kinds of files and of damages take turns; file and place are random. A trial depends on the
    seed and its number alone; finished ones are kept in `work`, so that an interrupted measurement
    goes on. Raises InputError if something is wrong with the dataset itself, or if it is not
    scored.
    """
    wrong = next(iter(_faults(dataset)), None)
    if wrong is not None:
        raise InputError(f"{dataset}: is damaged already ({wrong}), allowed is an intact dataset")
    run = digest(f"{seed} {digest(read_bytes(dataset / 'truth' / HASHES))}".encode())
    finished = {trial.number: trial for trial in _read(work / _FINISHED, run)}
    remaining = [number for number in range(count) if number not in finished]
    with Pool(max(min(workers, len(remaining)), 1), Laboratory, (dataset, work)) as pool:
        for first in range(0, len(remaining), _PER_JOB * workers):
            chosen = remaining[first : first + _PER_JOB * workers]
            jobs = [("trials", (chosen[n::workers], seed)) for n in range(workers)]
            done = partial(_report, progress, len(finished), count)
            for trials in pool.run(jobs, done):
                finished |= {trial.number: trial for trial in trials}
            records = [{"run": run, **trial._asdict()} for trial in finished.values()]
            write_text(work / _FINISHED, "".join(f"{json.dumps(one)}\n" for one in records))
    for folder in work.glob("worker_*"):
        shutil.rmtree(folder)
    return [finished[number] for number in range(count)]


def _report(progress: Callable[[int, int], None], before: int, count: int, done: int) -> None:
    progress(before + done, count)


def _read(path: Path, run: str) -> Iterator[Trial]:
    """Read the finished trials of an interrupted measurement."""
    lines = path.read_text(encoding="utf-8").splitlines() if path.is_file() else []
    for record in map(json.loads, lines):
        if record.pop("run") == run:
            yield Trial(**record)


@dataclass
class Laboratory:
    """One process that damages its own copy of a dataset, in a new folder below `work`."""

    dataset: Path
    work: Path
    _expected: dict[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        folder = self.work / f"worker_{os.getpid()}"
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        self._intact, self._copy = folder / "intact", folder / "copy"
        shutil.copytree(self.dataset, self._copy)
        # The results that commands write may differ from the dataset's in path and machine.
        for name in reversed(READERS):
            READERS[name](self._copy)
        self._opened = {name: self._files_opened_by(name) for name in READERS}
        self._expected = {name: reader(self._copy) for name, reader in READERS.items()}
        shutil.copytree(self._copy, self._intact)
        self._names = defaultdict[str, list[str]](list)
        for path in sorted(self._intact.rglob("*")):
            if path.is_file():
                name = path.relative_to(self._intact).as_posix()
                self._names[kind_of(name)].append(name)

    def _files_opened_by(self, command: str) -> set[str]:
        """List the files that a command opens for reading, by their names in the dataset."""
        opened, active = set[str](), True

        def hook(event: str, arguments: tuple[Any, ...]) -> None:
            if active and event == "open" and isinstance(arguments[0], str | Path):
                path = Path(arguments[0])
                if path.is_relative_to(self._copy):
                    opened.add(path.relative_to(self._copy).as_posix())

        sys.addaudithook(hook)  # cannot be removed, only made inactive
        READERS[command](self._copy)
        active = False
        return opened

    def trials(self, tick: Callable[[], None], numbers: Sequence[int], seed: int) -> list[Trial]:
        """Do the trials with some numbers."""
        trials = []
        for number in numbers:
            trials.append(self._trial(number, np.random.default_rng((seed, number))))
            tick()
        return trials

    def _trial(self, number: int, rng: np.random.Generator) -> Trial:
        kinds = sorted(self._names)
        kind = kinds[number % len(kinds)]
        damage = list(DAMAGES)[number // len(kinds) % len(DAMAGES)]
        name = self._names[kind][int(rng.integers(len(self._names[kind])))]
        DAMAGES[damage](self._copy / name, rng)
        named = any(fault.path == self._copy / name for fault in _faults(self._copy))
        # A command that never opens a file cannot notice that its content has changed.
        outcomes = {
            command: SAME
            if damage in _SAME_NAMES and name not in self._opened[command]
            else self._outcome(command)
            for command in READERS
        }
        self._restore(Path(name).parent)
        return Trial(number, name, kind, damage, named, outcomes)

    def _outcome(self, command: str) -> str:
        try:
            result = READERS[command](self._copy)
        except InputError:
            return REFUSED
        except Exception:  # noqa: BLE001  # any other error is a finding
            return CRASHED
        return SAME if result == self._expected[command] else SILENT

    def _restore(self, folder: Path) -> None:
        """Restore a folder, without its subfolders, and those into which commands write."""
        for name in {folder, *map(Path, _WRITTEN)}:
            for path in (self._copy / name).glob("*"):
                if path.is_file():
                    path.unlink()
            for path in (self._intact / name).glob("*"):
                if path.is_file():
                    shutil.copy2(path, self._copy / name)


def _faults(root: Path) -> list[Fault]:
    return list(faults(root, METHODS, Counts(), lambda _done, _total: None))
