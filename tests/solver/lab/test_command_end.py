"""Whatever ends a command line, it ends with one sentence and an exit status."""

import io
import os
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from rich.console import Console
from rich.table import Table

from solver.instrument.errors import InputError
from solver.lab.command_end import run_command
from solver.lab.command_line import main as solver_main
from vbaa_bench.cli import main as bench_main


def status_of(run: Callable[[], object]) -> object:
    with pytest.raises(SystemExit) as ended:
        run_command(run)
    return ended.value.code


@pytest.mark.parametrize("main", [solver_main, bench_main], ids=["solver", "bench"])
def test_a_full_disk_behind_the_output_is_one_sentence(
    main: Callable[[], None], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["command", "--help"])
    with Path("/dev/full").open("w", encoding="utf-8") as full:
        monkeypatch.setattr(sys, "stdout", full)
        with pytest.raises(SystemExit) as ended:
            main()
    assert ended.value.code == 2
    assert (
        capsys.readouterr().err == "error: the output cannot be written (No space left on device)\n"
    )


def test_a_reader_that_has_ended_is_no_error(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    reading, writing = os.pipe()
    os.close(reading)
    with os.fdopen(writing, "w", encoding="utf-8") as broken:
        monkeypatch.setattr(sys, "stdout", broken)
        assert status_of(lambda: print("one line")) == 1
    assert capsys.readouterr().err == ""


def test_an_output_of_ascii_replaces_the_mark_of_a_cut_cell(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    written = io.BytesIO()
    monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(written, encoding="ascii"))
    table = Table()
    table.add_column("message", no_wrap=True, max_width=8)
    table.add_row("a long message")
    assert status_of(lambda: Console().print(table)) == 0
    assert b"a long ?" in written.getvalue()


def test_a_closed_output_is_no_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stdout", None)
    assert status_of(lambda: Console().print("lost")) == 0
    sys.stdout.close()


@contextmanager
def handled(number: signal.Signals, by: signal.Handlers) -> Iterator[None]:
    """Handle a signal so, however the tests were started: nohup ignores SIGHUP."""
    before = signal.signal(number, by)
    try:
        yield
    finally:
        signal.signal(number, before)


@pytest.mark.parametrize("number", [signal.SIGHUP, signal.SIGTERM])
def test_a_signal_ends_a_command_as_ctrl_c_does(number: signal.Signals) -> None:
    with handled(number, signal.SIG_DFL):
        assert status_of(lambda: os.kill(os.getpid(), number)) == 128 + number
        assert signal.getsignal(number) is signal.SIG_DFL


def test_ctrl_c_within_compiled_code_is_ctrl_c() -> None:
    """Numba answers it with an error of the interpreter, whose cause it is."""

    def run() -> None:
        raise SystemError("returned a result with an exception set") from KeyboardInterrupt()

    def broken() -> None:
        raise SystemError("something else")

    assert status_of(run) == 130
    with pytest.raises(SystemError):
        run_command(broken)


def test_a_signal_that_is_ignored_stays_so() -> None:
    with handled(signal.SIGHUP, signal.SIG_IGN):
        assert status_of(lambda: os.kill(os.getpid(), signal.SIGHUP)) == 0


def test_an_input_error_is_one_sentence_and_an_error_of_the_program_is_not_hidden(
    capsys: pytest.CaptureFixture[str],
) -> None:
    def raising(error: Exception) -> Callable[[], object]:
        def run() -> None:
            raise error

        return run

    assert status_of(raising(InputError("a.yaml: key 'x' is 1, allowed is 2"))) == 2
    assert capsys.readouterr().err == "error: a.yaml: key 'x' is 1, allowed is 2\n"
    with pytest.raises(FileNotFoundError):
        run_command(raising(FileNotFoundError(2, "No such file", "a")))
