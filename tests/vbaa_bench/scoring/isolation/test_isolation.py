"""What a method cannot do to the scores by accident or by a cheap trick."""

import csv
import json
import socket
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from solver.instrument.estimate import Estimate, Outcome
from solver.lab.table import row
from tests.vbaa_bench.scoring.isolation.test_runs import is_alive
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.scoring.isolation import runs
from vbaa_bench.scoring.isolation.connection import (
    MessageError,
    Stamps,
    SupervisorEnd,
    WorkerEnd,
    checked_row,
    frame_of,
)
from vbaa_bench.scoring.isolation.runs import solve

HOSTILE = """
import gc, json, mmap, os, socket, sys, time
from pathlib import Path
from solver.lab.table import row
from solver import Estimate, Outcome

HERE = Path({here!r})
ANSWER = Estimate(Outcome.NOT_IDENTIFIABLE, "an answer")

def patch_clocks():
    start, now = time.perf_counter(), time.perf_counter
    time.perf_counter = time.process_time = time.monotonic = lambda: 0.0
    while now() < start + 0.2:
        pass

def forge():
    message = {{"kind": "row", "index": 3, "row": row("another", ANSWER, 0.0)}}
    for one in gc.get_objects():
        if isinstance(one, socket.socket) and one.type == socket.SOCK_STREAM:
            one.sendall(json.dumps(message).encode() + b"\\n")

def share_memory():
    shared = mmap.mmap(-1, 2 * 10**9)
    for place in range(0, len(shared), mmap.PAGESIZE):
        shared[place] = 1
    time.sleep(1e6)

def leave_a_daemon():
    if os.fork() == 0:
        os.setsid()
        if os.fork() == 0:
            (HERE / "daemon").write_text(str(os.getpid()))
            time.sleep(1e6)
        os._exit(0)
    os.wait()
    while not ((HERE / "daemon").is_file() and (HERE / "daemon").stat().st_size):
        pass

def tricks(measurement):
    if measurement.view.tip is None:  # warming up
        return ANSWER
    with (HERE / "calls").open("a") as calls:
        calls.write("x")
    number = (HERE / "calls").stat().st_size
    (patch_clocks, forge, share_memory, leave_a_daemon)[number - 1]()
    return ANSWER

def stuck(measurement):
    while True:
        pass
"""


def solved_rows(dataset: Path, folder: Path, method: str, **limits: Any) -> list[dict[str, str]]:
    (folder / "hostile.py").write_text(HOSTILE.format(here=str(folder)), encoding="utf-8")
    out = folder / "out.csv"
    solve(Layout(dataset), f"hostile:{method}", out, 1, **limits)
    with out.open(encoding="utf-8") as stream:
        return list(csv.DictReader(stream))


@pytest.mark.thorough
def test_cheap_tricks_cost_their_frame_and_no_process_is_left(
    dataset: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    rows = solved_rows(dataset, tmp_path, "tricks", memory_gb=1.5)
    by_message = {one["message"]: one for one in rows}
    assert by_message.keys() == {
        "an answer",
        "the method's process sent a message out of turn",
        "the method needs more than 1.5 GB, the limit of --memory",
    }
    # Two frames have answers: that of the patched clocks, and that of the daemon.
    times = [float(one["image_ms"]) for one in rows if one["message"] == "an answer"]
    used = [float(one["processor_ms"]) for one in rows if one["message"] == "an answer"]
    assert len(times) == 2
    assert max(times) > 100  # 200 by the judge's clock, 0 by the patched one
    assert min(used) > 0
    assert all(float(one["reference_ms"]) > 0 for one in rows if one["reference_ms"])
    assert not is_alive(int((tmp_path / "daemon").read_text(encoding="utf-8")))


@pytest.mark.thorough
def test_a_stuck_method_is_given_up_and_its_warm_up_counts(
    dataset: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    messages = [one["message"] for one in solved_rows(dataset, tmp_path, "stuck", frame_s=0.3)]
    reason = "timed out: no answer within 0.3 s"
    not_tried = f"not tried, 3 losses in a row; last {reason}"
    assert sorted(messages) == [not_tried, not_tried, reason, reason]


def test_a_method_gets_the_choice_of_kernels_and_no_import_path(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    chosen = {"OPENBLAS_CORETYPE": "Haswell", "NPY_DISABLE_CPU_FEATURES": "AVX512F"}
    for name, value in {**chosen, "NUMBA_CPU_NAME": "znver3", "SECRET": "x"}.items():
        monkeypatch.setenv(name, value)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.py").write_text("", encoding="utf-8")
    environment = runs._environment("mine:f", tmp_path / "folder")
    assert chosen.items() <= environment.items()
    assert environment["NUMBA_CPU_NAME"] == "znver3"
    assert not environment.keys() & {"SECRET", "PYTHONPATH"}


def test_a_method_is_run_by_the_copy_of_the_program_that_runs_here(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The installed one may be another, as beside a second checkout."""
    modules = {
        "solver/instrument/quick_imports.py": "from contextlib import nullcontext as quick_imports",
        "vbaa_bench/scoring/isolation/supervisor.py": "def main():\n    print(__file__)",
    }
    for name, text in modules.items():
        path = tmp_path / name
        path.parent.mkdir(parents=True)
        path.write_text(text, encoding="utf-8")
    for folder in tmp_path.rglob("*/"):
        (folder / "__init__.py").touch()
    monkeypatch.setattr(runs, "ROOT", tmp_path)
    environment = runs.one_core_environment()
    with runs._supervisor((), tmp_path, environment, print) as pipes:
        assert pipes.reports.read().decode().strip() == str(path)


@pytest.fixture
def pair() -> Iterator[tuple[socket.socket, socket.socket]]:
    ours, its = socket.socketpair()
    with ours, its:
        yield ours, its


Pair = tuple[socket.socket, socket.socket]


@pytest.mark.parametrize(
    "line",
    [
        b"not JSON",
        b"\xff\xfe",
        b"[" * 100_000,
        b"[]",
        b"null",
        b"{}",
        b'{"kind": ["row"]}',
        b'{"kind": "ready"}',
    ],
)
def test_a_malformed_message_is_refused(line: bytes, pair: Pair) -> None:
    supervisor = SupervisorEnd(pair[0], lambda: False)
    pair[1].sendall(line + b"\n")
    with pytest.raises(MessageError):
        supervisor.receive(time.monotonic() + 60, "row")


def test_an_endless_message_is_refused_and_a_begun_one_is_not_waited_for(pair: Pair) -> None:
    def goes_on() -> bool:  # called while the supervisor waits
        pair[1].send(b"x" * 60_000)
        return False

    pair[1].setblocking(False)
    supervisor = SupervisorEnd(pair[0], goes_on)
    pair[1].send(b"x" * 100_000)
    with pytest.raises(TimeoutError):
        supervisor.receive(time.monotonic() + 0.01, "row")
    with pytest.raises(MessageError, match="of more than"):
        supervisor.receive(time.monotonic() + 60, "row")


def test_the_last_message_of_a_process_that_has_ended_is_read(pair: Pair) -> None:
    supervisor = SupervisorEnd(pair[0], lambda: True)
    pair[1].sendall(b'{"kind": "row"}\n')
    assert supervisor.receive(time.monotonic() + 60, "row") == {"kind": "row"}
    with pytest.raises(EOFError):
        supervisor.receive(time.monotonic() + 60, "row")


def test_a_message_before_its_turn_is_refused(pair: Pair) -> None:
    supervisor = SupervisorEnd(pair[0], lambda: False)
    pair[1].sendall(b'{"kind": "start"}\n{"kind": "stop"}\n')
    supervisor.receive(time.monotonic() + 60, "start")
    with pytest.raises(MessageError, match="out of turn"):
        supervisor.answer()


def message(**changes: Any) -> dict[str, Any]:
    cells = row("frame", Estimate(Outcome.NO_CONTACT), 1.0) | changes.pop("row", {})
    sent: dict[str, Any] = {"traceback": "", "information": "", "faults": [], "peak_mb": None}
    return {"index": 2, "row": cells, **sent, **changes}


@pytest.mark.parametrize(
    "changes",
    [
        {"index": 3},
        {"index": "2"},
        {"row": {"frame_id": "another"}},
        {"row": {"outcome": "excellent"}},
        {"row": {"outcome": ["contact"]}},
        {"row": {"message": "\ud800"}},
        {"row": {"message": "x" * 10_000}},
        {"row": {"x_c_mm": "12"}},
        {"row": {"x_c_mm": float("nan")}},
        {"row": {"x_c_mm": True}},
        {"row": {"iterations": 10**400}},
        {"row": {"another_column": 1.0}},
        {"information": "everything"},
        {"traceback": None},
        {"faults": "none"},
        {"faults": [1]},
        {"peak_mb": "much"},
    ],
)
def test_a_row_of_another_form_or_frame_is_refused(changes: dict[str, Any]) -> None:
    json.dumps(changes)  # a process could send it
    assert checked_row(message(), 2, "frame") == message()
    with pytest.raises(MessageError):
        checked_row(message(**changes), 2, "frame")


@pytest.mark.parametrize("index", [None, "1", 5, True, 1.0, [1]])
def test_only_a_frame_that_is_left_can_be_begun(index: object) -> None:
    assert frame_of({"index": 1}, {1, 2}) == 1
    with pytest.raises(MessageError):
        frame_of({"index": index}, {1, 2})


def test_the_kernel_stamps_what_a_patched_clock_cannot_change(
    monkeypatch: pytest.MonkeyPatch, pair: Pair
) -> None:
    stamps = Stamps()
    pair[0].sendall(b"\n\n")  # the supervisor's replies
    worker = WorkerEnd(pair[1], stamps.sender)
    sleep = time.sleep
    with monkeypatch.context() as patch:
        for name in ("perf_counter", "process_time", "monotonic", "time"):
            patch.setattr(time, name, lambda: 0.0)
        with worker.timed("frame"):
            sleep(0.02)
    start, stop = stamps.read()
    assert stop - start >= 20e6
    assert stamps.read() == []
    stamps.close()
