"""Worker processes: they say why they cannot start, end with their parent, and bear Ctrl-C."""

import importlib
import multiprocessing
import os
import signal
import subprocess
import sys
import warnings
from collections import Counter, deque
from pathlib import Path

import pytest

from tests.vbaa_bench.residents import Grown, InterruptedAtImport, Resident, broken
from vbaa_bench.workers import pool as pools
from vbaa_bench.workers.jobs import Job, WorkerStartError
from vbaa_bench.workers.pool import Pool
from vbaa_bench.workers.resources import cores

ROOT = Path(__file__).parents[3]
# The package has a function of this name.
command = importlib.import_module("vbaa_bench.cli.main")


def test_a_worker_that_cannot_start_says_why() -> None:
    with (
        pytest.raises(WorkerStartError, match="could not start: OSError: the lamp is missing"),
        Pool(1, broken, (OSError,)) as pool,
    ):
        pool.call("pid")


def test_an_interrupt_while_workers_start_is_the_parents_alone(
    capfd: pytest.CaptureFixture[str],
) -> None:
    with Pool(1, Resident, (InterruptedAtImport(),)) as pool:
        assert pool.call("pid") != os.getpid()
    assert capfd.readouterr().err == ""


def test_a_worker_that_does_not_finish_its_piece_ends_with_an_interrupt(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def interrupted_at_first_piece(pieces: int) -> None:
        if pieces:
            raise KeyboardInterrupt

    monkeypatch.setattr(pools, "GRACE_S", 0.1)
    with pytest.raises(KeyboardInterrupt), Pool(1, Resident, ()) as pool:
        pool.run([("slow", ())], interrupted_at_first_piece)
    assert not multiprocessing.active_children()


@pytest.mark.thorough
@pytest.mark.skipif(sys.platform == "win32", reason="memory is not measured there")
@pytest.mark.parametrize(("growth_mb", "jobs_each"), [(-1.0, 1), (60.0, 3), (1e6, 6)])
def test_a_worker_whose_memory_has_grown_is_replaced_after_its_job(
    monkeypatch: pytest.MonkeyPatch, growth_mb: float, jobs_each: int
) -> None:
    def count(pieces: int) -> None:
        counts.append(pieces)
        assert len(multiprocessing.active_children()) <= 1

    counts, numbers, kept_mb = list[int](), range(6), 40
    monkeypatch.setattr(pools, "GROWTH_MB", growth_mb)
    with Pool(1, Resident, ()) as pool:
        results: list[Grown] = pool.run([("grow", (n, kept_mb)) for n in numbers], count)
    assert [result.number for result in results] == [*numbers]
    assert (counts[-1], sorted(counts)) == (len(numbers), counts)
    assert list(Counter(result.pid for result in results).values()) == [jobs_each] * (
        len(numbers) // jobs_each
    )
    first_mb = min(result.memory_mb for result in results)
    # Fresh processes need the same memory, up to a few MB.
    assert max(result.memory_mb for result in results) < first_mb + kept_mb * (jobs_each - 1) + 20


def test_a_process_that_dies_after_its_last_job_is_no_death(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(pools, "GROWTH_MB", -1.0)
    jobs = deque(Job("grow_and_break", (number,)) for number in range(3))
    with Pool(1, Resident, ()) as pool:
        outcomes = list(pool.outcomes(jobs, lambda _pieces: None))
    assert [(ended.result, ended.death) for ended in outcomes] == [(n, None) for n in range(3)]


def test_an_interrupt_while_workers_are_replaced_leaves_no_process(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def interrupted(pieces: int) -> None:
        if pieces >= 2:
            raise KeyboardInterrupt

    monkeypatch.setattr(pools, "GROWTH_MB", -1.0)
    with pytest.raises(KeyboardInterrupt), Pool(2, Resident, ()) as pool:
        pool.run([("grow", (number, 1)) for number in range(8)], interrupted)
    assert not multiprocessing.active_children()


def test_a_command_in_the_background_of_a_script_is_interrupted_too(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(command, "app", lambda: os.kill(os.getpid(), signal.SIGINT))
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)  # as a shell starts it
    try:
        with pytest.raises(SystemExit) as ended:
            command.main()
    finally:
        signal.signal(signal.SIGINT, before)
    assert ended.value.code == 130


def test_a_processor_that_polars_cannot_use_is_one_sentence(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def imports_polars() -> None:
        warnings.warn(
            "Missing required CPU features.\n\nThe following", RuntimeWarning, stacklevel=1
        )

    monkeypatch.setattr(command, "app", imports_polars)
    with pytest.raises(SystemExit) as ended:
        command.main()
    assert ended.value.code == 2
    assert capsys.readouterr().err == (
        "error: polars needs instructions that this processor lacks, such as AVX2: "
        "pip install 'polars[rtcompat]'\n"
    )


PARENT = """
import os, signal
from tests.vbaa_bench.residents import Resident
from vbaa_bench.workers.pool import Pool

if __name__ == "__main__":
    with Pool(1, Resident, ()) as pool:
        print(pool.call("pid"), flush=True)
        os.kill(os.getpid(), signal.SIGKILL)
"""


@pytest.mark.thorough
def test_workers_end_with_a_parent_that_was_killed() -> None:
    # The pipe's other end is the workers' too: it is at its end when all of them are.
    done = subprocess.run(
        [sys.executable, "-c", PARENT],
        cwd=ROOT,
        capture_output=True,
        timeout=60,
        check=False,
    )
    assert done.returncode == -signal.SIGKILL
    assert int(done.stdout) > 0


SCRIPT = """
from tests.vbaa_bench.residents import Resident
from vbaa_bench.workers.pool import Pool

with Pool(1, Resident, ()) as pool:
    print(pool.call("pid") > 0)
"""


@pytest.mark.thorough
def test_workers_start_from_a_plain_script_and_do_not_run_it_again(tmp_path: Path) -> None:
    script = tmp_path / "script.py"
    script.write_text(SCRIPT, encoding="utf-8")
    done = subprocess.run(
        [sys.executable, str(script)],
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stdout) == (0, "True\n"), done.stderr


FROM_A_FOLDER_OF_TRAPS = """
from solver import first_start
from tests.vbaa_bench.residents import Resident
from vbaa_bench.workers.pool import Pool
from vbaa_bench.render.variant import PLAIN, probe

with Pool(1, Resident, ()) as pool:
    print(pool.call("pid") > 0)
print(probe(PLAIN).works)
first_start.compiled_functions = set
with first_start.compile_in_background(None):
    pass
"""


@pytest.mark.thorough
def test_no_process_imports_from_the_folder_where_it_starts(tmp_path: Path) -> None:
    traps, script = tmp_path / "traps", tmp_path / "script.py"
    script.write_text(FROM_A_FOLDER_OF_TRAPS, encoding="utf-8")
    traps.mkdir()
    for module in ("struct", "json", "pickle", "signal", "multiprocessing", "mitsuba"):
        trap = f"open({str(tmp_path / 'sprung')!r}, 'a').write({module!r})\nraise SystemExit(1)\n"
        (traps / f"{module}.py").write_text(trap, encoding="utf-8")
    done = subprocess.run(
        [sys.executable, str(script)],
        cwd=traps,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stdout) == (0, "True\nTrue\n"), done.stderr
    assert not (tmp_path / "sprung").exists()


def test_a_pool_leaves_no_semaphore_behind_where_all_its_processes_are_killed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def made(*_: object) -> None:
        pytest.fail("a named semaphore stays in /dev/shm until somebody removes it")

    monkeypatch.setattr("multiprocessing.synchronize.SemLock.__init__", made)
    with Pool(1, Resident, ()) as pool:
        assert pool.call("pid") != os.getpid()


IMPORTING = """
import os, signal, sys

class CtrlC:
    def find_spec(self, name, path=None, target=None):
        if name == "typer":
            os.kill(os.getpid(), signal.SIGINT)

sys.meta_path.insert(0, CtrlC())
from vbaa_bench.cli import main
"""


RUNNING = (
    IMPORTING.replace('"typer"', '"mitsuba"')
    + """
sys.argv = ["vbaa-bench", "score", "dataset"]
main()
"""
)


@pytest.mark.thorough
@pytest.mark.parametrize("code", [IMPORTING, RUNNING], ids=["the_command", "what_it_needs"])
def test_an_interrupt_while_importing_is_no_traceback(code: str) -> None:
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (130, "")


def test_only_the_cores_that_may_be_used_are_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("os.sched_getaffinity", lambda _pid: {3}, raising=False)
    monkeypatch.setattr("os.process_cpu_count", lambda: 1, raising=False)
    assert cores() == 1
