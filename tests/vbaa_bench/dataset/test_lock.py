import errno
import json
import os
import signal
import socket
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from solver.instrument.errors import InputError
from solver.instrument.files import sync_folder
from vbaa_bench.dataset import lock as lock_file
from vbaa_bench.dataset.lock import locked

# As `locked` does, without what takes seconds to import.
HOLD = """
import fcntl, json, os, sys

file = open(sys.argv[1], "w")
fcntl.flock(file, fcntl.LOCK_EX)
json.dump({"pid": os.getpid(), "host": "here", "since": "today"}, file)
file.flush()
print("held", flush=True)
sys.stdin.read()
"""


def test_a_lock_names_its_holder_and_ends_with_it(tmp_path: Path) -> None:
    lock = tmp_path / ".lock"
    command = [sys.executable, "-c", HOLD, str(lock)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as holder:
        assert holder.stdout is not None
        assert holder.stdout.readline() == b"held\n"
        with (
            pytest.raises(InputError, match=f"process {holder.pid} on here since today"),
            locked(lock),
        ):
            pass
        holder.send_signal(signal.SIGKILL)
    assert json.loads(lock.read_text())["pid"] == holder.pid  # the dead bars nobody
    with locked(lock):
        assert json.loads(lock.read_text())["pid"] == os.getpid()
    assert not lock.exists()


def test_a_folder_is_synced_only_where_it_can_be_opened(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(*_: object) -> int:
        raise PermissionError(13, "Permission denied")

    with monkeypatch.context() as windows:
        windows.setattr("os.open", refused)
        with pytest.raises(PermissionError):
            sync_folder(tmp_path)
        windows.setattr("solver.instrument.files._IS_WINDOWS", True)
        sync_folder(tmp_path)


def test_a_file_takes_the_place_of_a_lock_where_there_are_none(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def unsupported(*_: object) -> None:
        raise OSError(errno.ENOLCK, "No locks available")

    monkeypatch.setattr(lock_file, "_acquire", unsupported)
    lock, owner = tmp_path / ".lock", tmp_path / ".lock.owner"
    with locked(lock):
        assert json.loads(owner.read_text())["pid"] == os.getpid()
        with (
            pytest.raises(InputError, match=f"process {os.getpid()} on .*delete .*owner"),
            locked(lock),
        ):
            pass
    assert not list(tmp_path.iterdir())
    # As with a lock, a second process may wait for the first.
    foreign = json.dumps({"pid": 1, "host": "another", "since": "today"})
    owner.write_text(foreign)
    threading.Timer(0.2, owner.unlink).start()
    with locked(lock, wait_s=60.0):
        assert json.loads(owner.read_text())["pid"] == os.getpid()
    # A process of this machine that has died bars nobody; another machine's may still run.
    dead = subprocess.run(
        [sys.executable, "-c", "import os; print(os.getpid())"], capture_output=True, check=True
    )
    holder = {"pid": int(dead.stdout), "host": socket.gethostname(), "since": "today"}
    owner.write_text(json.dumps(holder))
    with locked(lock):
        pass
    owner.write_text(json.dumps({**holder, "host": "another"}))
    with pytest.raises(InputError, match="on another since today"), locked(lock):
        pass
