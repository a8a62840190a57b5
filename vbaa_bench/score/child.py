"""A method runs in a child process that is given a copy of the observations and nothing else."""

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from solver.instrument.errors import InputError
from solver.instrument.estimate import Estimate, Outcome
from solver.instrument.files import write_text
from solver.instrument.observation import open_observations
from solver.table import csv_text, row
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.dataset.readers import check_complete, copy_observations
from vbaa_bench.score.layout import USUAL_CENTRELINE

# A method that takes longer than this for a frame, repeats included, has given no answer [s].
LONGEST_FRAME_S = 60


def solve(
    layout: Layout, method: str, out: Path, repeats: int, centreline: str = USUAL_CENTRELINE
) -> None:
    """Write `out`, the CSV of a method's estimates for every frame of a dataset's observations.

    A method that brings its process down, or never ends, gives a table in which every frame is
    crashed. `centreline` names how the beam is measured. Raises InputError for a method or a
    centreline that cannot be found, for rest images in which that centreline sees no beam, for
    observations that are not what was generated, and for an unwritable `out`.
    """
    check_complete(layout)
    frames = open_observations(layout.observations).frames
    with tempfile.TemporaryDirectory(prefix="vbaa-solve-") as folder:
        copy, answer = Path(folder) / "observations", Path(folder) / "answer.csv"
        copy_observations(layout, copy)
        command = [sys.executable, "-m", "solver", str(copy), "--method", method, "--quiet"]
        command += ["--centreline", centreline, "--repeats", str(repeats), "--out", str(answer)]
        try:
            child = subprocess.run(
                command,
                cwd=folder,
                env=_environment(method, Path(folder)),
                stdout=subprocess.DEVNULL,
                stderr=subprocess.PIPE,
                text=True,
                errors="replace",
                timeout=LONGEST_FRAME_S * len(frames),
                check=False,
            )
            status, said = child.returncode, child.stderr.strip()
        except subprocess.TimeoutExpired:
            status, said = None, "no answer in time"
        if status == 2 and said.startswith("error: "):
            raise InputError(said.removeprefix("error: ").replace(folder + os.sep, ""))
        if status == 0 and answer.is_file():
            text = answer.read_text(encoding="utf-8")
        else:
            last = said.splitlines()[-1] if said else f"exit status {status}"
            crashed = Estimate(Outcome.CRASHED, f"the method's process died: {last}")
            text = csv_text([row(frame.frame_id, crashed, None) for frame in frames])
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        write_text(out, text)
    except OSError as error:
        raise InputError(f"{out}: cannot be written ({error.strerror})") from error


def _environment(method: str, folder: Path) -> dict[str, str]:
    """No more than a process needs, and nothing that says where it was started from.

    Somebody's own module, found in the current folder or on PYTHONPATH, is copied into `folder`:
    the place it came from may have truth beside it. This keeps a method from meeting the truth
    by accident; it is no jail for one that searches the disk.
    """
    kept = ("PATH", "HOME", "LANG", "LD_LIBRARY_PATH", "SYSTEMROOT")
    environment = {name: os.environ[name] for name in kept if name in os.environ}
    # One thread: times are of one core, whatever the machine.
    environment |= {f"{name}_NUM_THREADS": "1" for name in ("OMP", "OPENBLAS", "MKL", "NUMBA")}
    environment["OPENCV_FOR_THREADS_NUM"] = "1"
    module, colon, _ = method.partition(":")
    top = module.partition(".")[0]
    if colon and top:
        elsewhere = os.environ.get("PYTHONPATH", "").split(os.pathsep)
        for place in (Path.cwd(), *(Path(name) for name in elsewhere if name)):
            if (place / top).is_dir():
                shutil.copytree(place / top, folder / "method" / top)
            elif (place / f"{top}.py").is_file():
                (folder / "method").mkdir()
                shutil.copy(place / f"{top}.py", folder / "method")
            else:
                continue
            environment["PYTHONPATH"] = str(folder / "method")
            break
    return environment
