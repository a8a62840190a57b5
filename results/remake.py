"""Make a folder of results again:  python -m results.remake results/NAME

The version of the program and the rendering target are recorded beside them.

REPOSITORY/results/NAME/remake.sh holds the commands. It runs in the repository, with the variables
FROM, the folder of results as it is, OUT, the folder for new files, and RUNS, one for datasets.
"""

import importlib.metadata
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any, Final

import typer

from solver.instrument.errors import InputError
from solver.instrument.files import write_bytes, write_text
from solver.lab.command_end import run_command
from vbaa_bench.cli.options import AsJson
from vbaa_bench.dataset.document import read_json
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.dataset.program import versions
from vbaa_bench.report.console import print_result
from vbaa_bench.scoring.summary import machine

SCRIPT: Final = "remake.sh"
RECORD: Final = "made_with.json"
# Last paragraph of the README of each folder of results.
NOTE: Final = """
`python -m results.remake {folder}` makes the files of this folder again ([the script](remake.sh)),
and records version and rendering target in `made_with.json`. Files without this record are of an
earlier version.
"""
# Time limit [s]. From the requirement: 90 minutes on two cores.
LIMIT_S: Final = 90 * 60.0


def remake(folder: Path, work: Path, limit_s: float = LIMIT_S) -> dict[str, Any]:
    """Run the script of a folder of results; replace its files, and write made_with.json.

    Datasets are in the folder `work`, and are kept there. Files are replaced only if the whole
    script has ended without an error within `limit_s`. Returns the record: the version and commit
    of this project, what the datasets were made with, packages, machine and minutes. Raises
    InputError.
    """
    script = folder / SCRIPT
    if not script.is_file():
        raise InputError(f"{folder}: holds no {SCRIPT}; it is not a folder of results")
    runs, out = work / "datasets", work / "out"
    start = time.monotonic()
    try:
        for path in (runs, out):
            path.mkdir(parents=True, exist_ok=True)
        for path in _files(out):  # of a run that was stopped
            path.unlink()
        with _started(script, folder, runs, out) as process:
            status = process.wait(limit_s)
    except subprocess.TimeoutExpired as error:
        raise InputError(f"{script}: did not end within {limit_s / 60:g} minutes") from error
    except OSError as error:
        raise InputError(f"{script}: cannot be run ({error.strerror})") from error
    if status:
        raise InputError(f"{script}: ended with exit status {status}; nothing was replaced")
    record = {
        "command": f"python -m results.remake {folder}",
        "version": importlib.metadata.version("vbaa-bench"),
        "commit": _commit(folder),
        "datasets_made_with": _made_with(runs),
        "packages": versions(),
        "machine": machine(),
        "minutes": round((time.monotonic() - start) / 60, 1),
    }
    for path in _files(out):
        target = folder / path.relative_to(out)
        target.parent.mkdir(parents=True, exist_ok=True)
        note = note_of(folder).encode() if target == folder / "README.md" else b""
        write_bytes(target, path.read_bytes() + note)
    write_text(folder / RECORD, json.dumps(record, indent=2) + "\n")
    return record


def note_of(folder: Path) -> str:
    """Return the paragraph on how a folder of results is made again."""
    return NOTE.format(folder=f"results/{folder.resolve().name}")


@contextmanager
def _started(
    script: Path, folder: Path, runs: Path, out: Path
) -> Iterator[subprocess.Popen[bytes]]:
    """Start the script; end it with all its processes if it is still running afterwards."""
    folders = {"FROM": folder, "RUNS": runs, "OUT": out}
    environment = os.environ | {name: str(path.resolve()) for name, path in folders.items()}
    # The vbaa-bench of this program.
    environment["PATH"] = f"{Path(sys.executable).parent}{os.pathsep}{os.environ.get('PATH', '')}"
    process = subprocess.Popen(
        ["bash", "-eu", "-o", "pipefail", str(script.resolve())],
        cwd=folder.resolve().parent.parent,
        env=environment,
        start_new_session=True,
    )
    try:
        yield process
    finally:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()


def _files(folder: Path) -> list[Path]:
    return sorted(path for path in folder.rglob("*") if path.is_file())


def _made_with(runs: Path) -> Any:
    """Return what the identity of the first dataset states; None without a dataset."""
    for path in sorted(runs.rglob(Layout(Path()).identity.name)):
        return read_json(path).get("made_with")
    return None


def _commit(folder: Path) -> str | None:
    """Return the commit of the repository that holds a folder; None outside of one."""
    try:
        command = ["git", "-C", str(folder), "describe", "--always", "--dirty"]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
    except OSError:
        return None
    return done.stdout.strip() or None


app = typer.Typer()


@app.command()
def main(
    folder: Annotated[Path, typer.Argument(help="folder of results, such as results/outline")],
    work: Annotated[
        Path | None,
        typer.Option(help="folder for datasets", show_default="runs/remake/<folder>"),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Make a folder of results again by its script, and record version and rendering target.

    It takes up to 90 minutes on two cores, and is then stopped. Files are replaced only at the end.
    """
    record = remake(folder, work or Path("runs", "remake", folder.resolve().name))
    print_result(record, f"{folder}: made again in {record['minutes']:g} minutes", as_json)


if __name__ == "__main__":
    run_command(app)
