"""A method's process: what it costs when it fails, and that nothing of it is left."""

import csv
import errno
import html
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from typer.testing import CliRunner

from solver.instrument.errors import InputError
from solver.instrument.estimate import Estimate, Outcome
from solver.lab.table import csv_text, row
from tests.sealing import reseal
from vbaa_bench import cli
from vbaa_bench.api import results as api
from vbaa_bench.cli import results as commands
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.report.report import report
from vbaa_bench.scoring.isolation import runs
from vbaa_bench.scoring.isolation.method_sources import copy_sources
from vbaa_bench.scoring.isolation.runs import Job, MethodRun, solve
from vbaa_bench.scoring.results_layout import Results

FAILING = """
import os, subprocess, sys, threading, time
from pathlib import Path
from solver.methods import METHODS
from neighbour import CALLS

def in_turn(measurement):
    if measurement.view.tip is None:  # warming up
        return METHODS["exact_fit"](measurement)
    with CALLS.open("a") as calls:
        calls.write("x")
    number = CALLS.stat().st_size
    if number == 1:
        sleeper = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(1e6)"])
        CALLS.with_name("sleeper").write_text(str(sleeper.pid))
        threading.Thread(target=time.sleep, args=(1e6,)).start()
        print("printed [/x]" + 50_000 * "." + "\\n" + 50_000 * ".")
    if number == 2:
        os._exit(7)
    if number == 3:
        return bytearray(3 * 10**9) if len(measurement.earlier) == 1 else "no past"
    if number == 4:
        time.sleep(1e6)
    return METHODS["exact_fit"](measurement)
"""


def write_methods(folder: Path) -> None:
    (folder / "neighbour.py").write_text(
        f"from pathlib import Path\nCALLS = Path({str(folder / 'calls')!r})\n", encoding="utf-8"
    )
    (folder / "failing.py").write_text(FAILING, encoding="utf-8")


def is_alive(pid: int) -> bool:
    try:
        stat = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8")
    except (FileNotFoundError, ProcessLookupError):  # it may end while it is looked up
        return False
    return stat.rpartition(")")[2].split()[0] != "Z"


def wait_until(condition: Any) -> None:
    """Poll; a minute is far more than any of these takes."""
    end = time.monotonic() + 60
    while not condition() and time.monotonic() < end:
        time.sleep(0.02)
    assert condition()


@pytest.mark.thorough
def test_each_failure_costs_its_own_frame_and_nothing_is_left(
    dataset: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    root, temporary = tmp_path / "data", tmp_path / "temporary"
    shutil.copytree(dataset, root)
    temporary.mkdir()
    write_methods(tmp_path)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(tempfile, "tempdir", str(temporary))
    # One push of four steps, so that a frame has a past that must survive.
    for step, table in enumerate(sorted(root.glob("observations/shard_*/metadata.csv"))):
        rows = list(csv.DictReader(table.read_text(encoding="utf-8").splitlines()))
        lines = ["file_name,motor_angle_deg,push_id,step"] + [
            f"{one['file_name']},{one['motor_angle_deg']},push,{2 * step + i}"
            for i, one in enumerate(rows)
        ]
        table.write_text("\n".join(lines) + "\n", encoding="utf-8")
    reseal(Layout(root))
    heard: list[str] = []
    out = root / "predictions" / "own.csv"
    solved = solve(
        Layout(root), "failing:in_turn", out, 1, memory_gb=2.5, frame_s=3.0, on_output=heard.append
    )
    with out.open(encoding="utf-8") as stream:
        messages = [one["message"] for one in csv.DictReader(stream)]
    assert messages == [
        Outcome.CONTACT.sentence,
        "the method's process died: exit status 7",
        "MemoryError: the method needs more than 2.5 GB, the limit of --memory",
        "timed out: no answer within 3 s",
    ]
    assert (solved.frames, solved.crashed) == (4, 3)
    assert 'File "failing.py", line 21, in in_turn' in solved.traceback
    assert "return bytearray(3 * 10**9)" in solved.traceback
    assert heard[0].startswith("printed [/x]...")
    assert "bytes more, not shown" in heard[-1]
    assert sum(map(len, heard)) < 2 * runs.MAX_OUTPUT
    sleeper = int((tmp_path / "sleeper").read_text(encoding="utf-8"))
    wait_until(lambda: not is_alive(sleeper))
    assert not list(temporary.iterdir())


@pytest.mark.thorough
def test_where_the_judge_is_killed_its_method_and_its_folder_go_too(
    dataset: Path, tmp_path: Path
) -> None:
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    (tmp_path / "slow.py").write_text(
        "import os, time\nfrom pathlib import Path\n"
        f"Path({str(tmp_path / 'pid')!r}).write_text(str(os.getpid()))\n"
        "time.sleep(1e6)\n",
        encoding="utf-8",
    )
    code = (
        "import sys; from pathlib import Path; from vbaa_bench.scoring.isolation.runs import *\n"
        "solve(Layout(Path(sys.argv[1])), 'slow:any', Path('out.csv'), 1)"
    )
    judge = subprocess.Popen(
        [sys.executable, "-c", code, str(dataset)],
        cwd=tmp_path,
        env={**os.environ, "TMPDIR": str(temporary)},
    )
    wait_until(lambda: (tmp_path / "pid").is_file() and (tmp_path / "pid").stat().st_size)
    method = int((tmp_path / "pid").read_text(encoding="utf-8"))
    assert is_alive(method)
    assert list(temporary.glob("*/observations*"))
    judge.send_signal(signal.SIGKILL)
    judge.wait()
    wait_until(lambda: not is_alive(method) and not list(temporary.iterdir()))


@pytest.mark.usefixtures("no_process")
def test_what_cannot_be_written_is_said_before_anything_is_solved(
    dataset: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(_of: Layout, _to: Path) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    (tmp_path / "predictions").write_text("")
    monkeypatch.setattr(runs, "copy_observations", full)
    out = tmp_path / "predictions" / "exact_fit.csv"
    with pytest.raises(InputError, match=r"exact_fit\.csv: cannot be written"):
        solve(Layout(dataset), "exact_fit", out, 1)
    with pytest.raises(InputError, match=r"cannot be copied .* \(No space left on device\)"):
        solve(Layout(dataset), "exact_fit", tmp_path / "out.csv", 1)


@pytest.mark.thorough
def test_an_earlier_table_is_kept_if_the_method_cannot_be_imported(
    dataset: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "broken.py").write_text("import a_library_that_is_not_here\n", encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.chdir(tmp_path)
    out = tmp_path / "broken.f.csv"
    out.write_text("estimates of an hour\n", encoding="utf-8")
    with pytest.raises(InputError, match="a_library_that_is_not_here"):
        solve(Layout(dataset), "broken:f", out, 1)
    assert out.read_text(encoding="utf-8") == "estimates of an hour\n"
    assert sorted(path.name for path in tmp_path.glob("*.csv*")) == ["broken.f.csv"]
    assert not list(tmp_path.glob(".*.part"))


@pytest.mark.thorough
def test_frames_of_a_rig_that_cannot_be_set_up_are_refusals_in_a_report(
    dataset: Path, tmp_path: Path
) -> None:
    root = tmp_path / "dark"
    shutil.copytree(dataset, root)
    for path in (root / "observations" / "calibration").iterdir():
        assert cv2.imwrite(str(path), np.zeros_like(cv2.imread(str(path), cv2.IMREAD_UNCHANGED)))
    reseal(Layout(root))
    with pytest.raises(InputError, match="method 'two_pint' is unknown"):
        api.solve(root, "two_pint")
    runs = api.solve(root, "two_point")
    # The user's own path, not that of the copy which the method was given.
    assert runs["two_point"].refusal.startswith(f"{root / 'observations'}: calibration view 0")
    scores = api.score(root, runs=runs).frames
    assert set(scores["outcome"]) == {str(Outcome.INVALID)}
    (message,) = set(scores["message"])
    assert message.startswith("calibration view 0")
    assert message in html.unescape(report(Results(root)).read_text(encoding="utf-8"))


def test_sources_and_neighbours_are_copied_and_datasets_are_not(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    files = {
        "mine/__init__.py": "import helping",
        "mine/deep/fit.py": "from helping.more import x\nfrom . import __init__",
        "mine/runs/small/truth/manifest.json": "{}",
        "mine/.venv/lib.py": "",
        "helping.py": "import helping, json, numpy, absent, solver",
        "solver/__init__.py": "",
        "unrelated.py": "",
        "truth/manifest.json": "{}",
    }
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text, encoding="utf-8")
    copy_sources("mine.deep.fit", tmp_path / "copy")
    copied = {p.relative_to(tmp_path / "copy").as_posix() for p in tmp_path.rglob("copy/**/*.*")}
    assert copied == {"mine/__init__.py", "mine/deep/fit.py", "helping.py"}


def test_numbers_beyond_a_floats_range_are_not_written() -> None:
    huge = Estimate(Outcome.CONTACT, values={"x_c_m": 1e306, "force_n": 1.0}, chi2=float("nan"))
    text = csv_text([row("a", huge, 1.0)])
    assert "inf" not in text
    assert "nan" not in text
    assert row("a", huge, 1.0)["x_c_mm"] is None


@pytest.mark.parametrize(("crashed", "status"), [(4, 1), (3, 0)])
def test_the_status_is_one_where_every_frame_crashed_and_the_traceback_is_shown(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, crashed: int, status: int
) -> None:
    trace = 'Traceback (most recent call last):\n  File "[/x].py", line 3\nRuntimeError: no idea'

    def pretended(jobs: list[Job], *_: Any) -> Iterator[MethodRun]:
        yield MethodRun(jobs[0].out, 4, crashed, trace)

    monkeypatch.setattr(api, "solve_each", pretended)
    monkeypatch.setattr(commands, "outcomes", lambda _table: "")
    done = CliRunner().invoke(cli.app, ["solve", str(tmp_path), "--method", "mine:f"])
    assert done.exit_code == status, done.output
    assert trace in done.stderr
