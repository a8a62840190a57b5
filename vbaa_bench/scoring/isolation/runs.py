"""Run methods in their own processes, which receive only a copy of the observations."""

import json
import os
import shutil
import subprocess
import tempfile
import threading
from collections import Counter
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any, Final, NamedTuple

from solver.instrument.errors import InputError
from solver.instrument.estimate import Estimate, Outcome
from solver.instrument.image_frame import LEARN
from solver.instrument.observation import Observations, open_observations
from solver.instrument.safe_path import PYTHON
from solver.lab.table import COLUMNS, Row, csv_text, row
from solver.lab.writing import prepare_output_path
from solver.methods import LEARNING, METHODS
from solver.methods.by_name import find_method
from vbaa_bench.dataset.copies import copy_observations
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.dataset.program import ROOT
from vbaa_bench.dataset.readers import check_complete
from vbaa_bench.dataset.recorded import write_results
from vbaa_bench.scoring.isolation.method_sources import SOURCES, copy_sources
from vbaa_bench.scoring.isolation.reference_kernel import PROCESSOR_COLUMN, REFERENCE_COLUMN
from vbaa_bench.scoring.results_layout import USUAL_CENTRELINE, Results

# Time limit for one frame, repeats included [s]; a method that exceeds it has crashed.
MAX_FRAME_S: Final = 60.0
# Memory limit of a method [GB]. Chosen: the solver itself needs less than 1 GB, and an ordinary
# computer has this much beside the scoring process.
MEMORY_GB: Final = 8.0
# Limit of the printed output that is passed on [characters]. Chosen: a few hundred lines.
MAX_OUTPUT: Final = 20_000
# Variables by which a library chooses its kernels for a processor, and so the last digits of its
# results, or where it keeps compiled code. A method must compute as the user's own processes do.
_KERNEL_CHOICES: Final = (
    *("OPENBLAS_CORETYPE", "OPENBLAS_L2_SIZE", "BLIS_ARCH_TYPE"),
    *("MKL_CBWR", "MKL_DEBUG_CPU_TYPE", "MKL_ENABLE_INSTRUCTIONS"),
    *("NPY_DISABLE_CPU_FEATURES", "NPY_ENABLE_CPU_FEATURES"),
    *("NUMBA_CPU_NAME", "NUMBA_CPU_FEATURES", "NUMBA_ENABLE_AVX", "NUMBA_OPT"),
    *("NUMBA_CACHE_DIR", "NUMBA_DISABLE_INTEL_SVML", "NUMBA_LOOP_VECTORIZE"),
    *("NUMBA_SLP_VECTORIZE", "OPENCV_CPU_DISABLE", "OPENCV_IPP"),
    # PyTorch's, and those of the C library's functions.
    *("ATEN_CPU_CAPABILITY", "ONEDNN_MAX_CPU_ISA", "DNNL_MAX_CPU_ISA", "GLIBC_TUNABLES"),
)
# Time limit for the supervisor to end after the request [s].
_MAX_END_S: Final = 10.0
# Time limit for reading the last of the printed output [s].
_MAX_REST_S: Final = 2.0
# The first argument is the folder of these packages: another copy of them may be the installed one.
_SUPERVISOR: Final = """
import sys
root = sys.argv.pop(1)
if root not in sys.path:
    sys.path.insert(0, root)
from solver.instrument.quick_imports import quick_imports
with quick_imports():
    from vbaa_bench.scoring.isolation.supervisor import main
main()
"""


@dataclass(frozen=True)
class MethodRun:
    """Result of running a method: its table, number of frames, of crashed ones, first traceback.

    `refusal` says why no frame could be solved, if the rig cannot be set up. `faults` counts the
    frames with each fault of `estimate_faults`; `peak_mb` is the largest memory of the method's
    process [MB], None if it is unknown.
    """

    table: Path
    frames: int
    crashed: int
    traceback: str
    refusal: str = ""
    faults: Mapping[str, int] = field(default_factory=dict)
    peak_mb: float | None = None


class Job(NamedTuple):
    """A method, the dataset that it is run on, the path of its table, and the frames, or all."""

    method: str
    layout: Layout
    out: Path
    frames: Sequence[int] | None = None


class RunSettings(NamedTuple):
    """How methods are run: on which centreline, how often on each frame, and with which limits.

    `memory_gb` is the memory of a method and of each process that it starts [GB], 0 for no limit;
    `frame_s` is the time for a frame, repeats included [s].
    """

    centreline: str
    repeats: int
    memory_gb: float = MEMORY_GB
    frame_s: float = MAX_FRAME_S


class _Pipes(NamedTuple):
    """Standard input and output of a supervisor."""

    requests: IO[bytes]
    reports: IO[bytes]


def applicable(observations: Observations) -> list[str]:
    """List the names of METHODS for which all is there: sensors, sequences, splits, gravity."""
    sensors = observations.rig.sensors
    pushes = [frame.push_id for frame in observations]
    inapplicable = set()
    if sensors.moment_y is None:
        inapplicable.add("moment_sensor")
    if sensors.base_force is None:
        inapplicable.add("force_sensor")
    if observations.rig.gravity is None:
        inapplicable.add("hung_weight")
    if len(set(pushes)) == len(pushes):
        inapplicable |= {"stiffness", "push_fit", "push_fit_friction"}
    if all(frame.split != LEARN for frame in observations):
        inapplicable |= LEARNING
    return [name for name in METHODS if name not in inapplicable]


def solve(
    layout: Layout,
    method: str,
    out: Path,
    repeats: int,
    centreline: str = USUAL_CENTRELINE,
    *,
    memory_gb: float = MEMORY_GB,
    frame_s: float = MAX_FRAME_S,
    on_output: Callable[[str], None] = lambda _line: None,
    frames: Sequence[int] | None = None,
) -> MethodRun:
    """Run a method on every frame of a dataset's observations; write its estimates to `out` as CSV.

    With `frames`, only the frames with these indices are solved, and only they are in the table.

    A frame has the outcome "crashed" if the method raises an error, terminates its process or takes
    longer than `frame_s`; other frames keep their estimates. After three consecutive frames that
    terminated the process, all remaining frames are crashed too. The method, and each process that
    it starts, may allocate `memory_gb`; 0 means no limit. `on_output` is called with each line that
    the method prints, up to MAX_OUTPUT characters. `centreline` is the name of the extraction
    method of the centreline. Where the rig cannot be set up, for example because that centreline
    detects no beam in the rest images, every frame has the outcome "invalid" with the reason.

    Raises InputError if the method is unknown, if the observations are not what was generated, or
    if `out` or a temporary folder cannot be written. An earlier table at `out` is then kept.
    """
    settings = RunSettings(centreline, repeats, memory_gb, frame_s)
    prepare_output_path(out)
    (run,) = solve_each([Job(method, layout, out, frames)], settings, on_output)
    return run


def solve_each(
    jobs: Sequence[Job],
    settings: RunSettings,
    on_output: Callable[[str], None] = lambda _line: None,
) -> Generator[MethodRun, None, None]:
    """Run methods on datasets, as `solve` does.

    One process runs them all, one after another, and sets up a dataset once for consecutive jobs.
    A method of the user's own needs a process of its own. The table of a dataset that is refused
    holds the reason in every row. Raises InputError as `solve` does.
    """
    remaining = list(jobs)
    for job in jobs:
        if ":" not in job.method:
            find_method(job.method)  # a misspelled name is found before anything is started
    while remaining:
        with _temporary_folder() as folder:

            def restored_paths(text: str, folder: Path = folder) -> str:
                """Replace paths of copies by the user's own paths."""
                sources = f"{folder / SOURCES}{os.sep}"
                return text.replace(sources, "").replace(f"{folder}{os.sep}", "")

            task = (str(folder), *map(str, settings))
            environment = _environment(remaining[0].method, folder)
            with _supervisor(
                task, folder, environment, lambda line: on_output(restored_paths(line))
            ) as pipes:
                alive, copied, copy = True, None, folder
                while alive and remaining:
                    job = remaining.pop(0)
                    prepare_output_path(job.out)
                    if job.layout != copied:
                        check_complete(job.layout)
                        if copied is not None:
                            shutil.rmtree(copy, ignore_errors=True)
                        # Never the same name twice: the process remembers what it has read.
                        copy = folder / f"observations_{len(remaining)}"
                        _copy(job.layout, copy)
                        copied = job.layout
                    run, alive = _solve(job, copy, pipes, restored_paths)
                    yield run


def solve_rigs(
    rigs: Mapping[int, Layout],
    methods: Mapping[str, str],
    settings: RunSettings,
    workers: int,
    on_rig: Callable[[], None],
    on_output: Callable[[str], None],
) -> dict[str, MethodRun]:
    """Run methods on all rigs, in `workers` processes; write each rig's predictions by name.

    `methods` are by the names of their predictions. A rig is set up once for all of them, so that a
    method of the user's own must be alone. `on_rig` is called after each rig. Return the numbers of
    frames of all rigs together, with the table of the first rig. Raises InputError if a method
    cannot be found.
    """

    def solve_share(share: Sequence[Layout]) -> list[MethodRun]:
        jobs = [
            Job(method, layout, Results(layout.root).predictions / f"{name}.csv")
            for layout in share
            for name, method in methods.items()
        ]
        runs = []
        for run in solve_each(jobs, settings, on_output):
            runs.append(run)
            if len(runs) % len(methods) == 0:
                on_rig()
        return runs

    datasets = list(rigs.values())
    with ThreadPoolExecutor(workers) as threads:
        shares = [share for n in range(workers) if (share := datasets[n::workers])]
        runs = [run for share in threads.map(solve_share, shares) for run in share]
    by_name = {name: runs[n :: len(methods)] for n, name in enumerate(methods)}
    return {name: _together(of_method) for name, of_method in by_name.items()}


def _together(runs: Sequence[MethodRun]) -> MethodRun:
    """Add up the frames of a method's runs; they are refused if those of every rig are."""
    refusal = runs[0].refusal if all(run.refusal for run in runs) else ""
    traceback = next((run.traceback for run in runs if run.traceback), "")
    frames, crashed = sum(run.frames for run in runs), sum(run.crashed for run in runs)
    return MethodRun(runs[0].table, frames, crashed, traceback, refusal)


def _solve(
    job: Job, copy: Path, pipes: _Pipes, restored_paths: Callable[[str], str]
) -> tuple[MethodRun, bool]:
    """Do one job on a copy of its observations.

    Return the run, and whether the process can do another. Raises InputError if the method cannot
    be found.
    """
    original = str(job.layout.observations)
    observations = open_observations(job.layout.observations)
    solved: dict[int, Row] = {}
    traceback, refusal, information, alive = "", "", "", False
    faults, peaks = Counter[str](), list[float]()
    with suppress(BrokenPipeError):  # its own output contains the reason
        pipes.requests.write(f"{json.dumps([job.method, str(copy), job.frames])}\n".encode())
        pipes.requests.flush()
    for line in pipes.reports:
        report: dict[str, Any] = json.loads(line)
        if "end" in report:
            alive = True
            break
        if "unusable" in report:
            raise InputError(restored_paths(report["unusable"]))
        if "refused" in report:
            refusal = restored_paths(report["refused"].replace(str(copy), original))
            continue
        solved[report["index"]] = report["row"]
        traceback = traceback or restored_paths(report.get("traceback", ""))
        information = report.get("information", information)
        faults.update(report.get("faults", ()))
        peaks += [report["peak_mb"]] if report.get("peak_mb") else []
    lost = Estimate(Outcome.CRASHED, "the process that runs the method died")
    if refusal:
        # Without the folder: tables and reports are copied to other places.
        reason = refusal.removeprefix(f"{original}: ").replace(f"{original}{os.sep}", "")
        lost = Estimate(Outcome.INVALID, reason)
    chosen = range(len(observations.frames)) if job.frames is None else job.frames
    rows = [
        solved.get(index) or row(observations.frames[index].frame_id, lost, None)
        for index in chosen
    ]
    # Only where it differs from what the scoring assumes.
    declared: Row = {"information": information} if information else {}
    text = csv_text(
        [entry | declared for entry in rows],
        (*COLUMNS, PROCESSOR_COLUMN, REFERENCE_COLUMN, *declared),
    )
    write_results(job.out.parent, {job.out.name: text.encode()})
    crashed = sum(entry["outcome"] == str(Outcome.CRASHED) for entry in rows)
    peak = max(peaks, default=None)
    return MethodRun(job.out, len(rows), crashed, traceback, refusal, faults, peak), alive


@contextmanager
def _temporary_folder() -> Iterator[Path]:
    """Create a folder that is removed at the end with its contents. Raises InputError."""
    try:
        folder = Path(tempfile.mkdtemp(prefix="vbaa-solve-"))
    except OSError as error:
        raise InputError(f"a temporary folder cannot be created ({error}); set TMPDIR") from error
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _copy(layout: Layout, target: Path) -> None:
    """Copy the observations for the method. Raises InputError."""
    try:
        copy_observations(layout, target)
    except OSError as error:
        raise InputError(
            f"{target.parent.parent}: the observations cannot be copied to this folder "
            f"({error.strerror}); set TMPDIR to a folder with more space"
        ) from error


@contextmanager
def _supervisor(
    task: tuple[str, ...],
    folder: Path,
    environment: Mapping[str, str],
    on_output: Callable[[str], None],
) -> Iterator[_Pipes]:
    """Start the process that runs the methods; yield its standard input and output.

    When its standard input ends, also because this process has ended, it ends with the method.
    """
    command = [*PYTHON, "-c", _SUPERVISOR, str(ROOT), *task]
    readable, writable = os.pipe()
    listener = threading.Thread(target=_listen, args=(readable, on_output), daemon=True)
    listener.start()
    with subprocess.Popen(
        command,
        cwd=folder,
        env=environment,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=writable,
        start_new_session=True,  # Ctrl-C reaches this process only, which then ends the method
    ) as process:
        os.close(writable)
        assert process.stdin is not None
        assert process.stdout is not None
        try:
            yield _Pipes(process.stdin, process.stdout)
        finally:
            with suppress(BrokenPipeError):
                process.stdin.close()
            try:
                process.wait(_MAX_END_S)
            except subprocess.TimeoutExpired:
                process.kill()
            # A process that has left the method's group may keep standard error open forever.
            listener.join(_MAX_REST_S)


def _listen(readable: int, on_output: Callable[[str], None]) -> None:
    """Pass on the method's output, line by line, up to a limit; read and drop the rest."""
    remaining, dropped = MAX_OUTPUT, 0
    with open(readable, "rb") as stream:
        while line := stream.readline(MAX_OUTPUT):
            text = line.decode("utf-8", "replace")
            if text := text[:remaining]:
                on_output(text.rstrip("\r\n"))
            remaining -= len(text)
            dropped += len(line) if not text else 0
    if dropped:
        on_output(f"... and {dropped} bytes more, not shown")


def one_core_environment() -> dict[str, str]:
    """Make the minimal environment of a process whose times are those of one core.

    Its libraries choose the same kernels as in the user's own processes.
    """
    inherited = ("PATH", "HOME", "LANG", "LD_LIBRARY_PATH", "SYSTEMROOT", *_KERNEL_CHOICES)
    environment = {name: os.environ[name] for name in inherited if name in os.environ}
    environment |= {f"{name}_NUM_THREADS": "1" for name in ("OMP", "OPENBLAS", "MKL", "NUMBA")}
    environment["OPENCV_FOR_THREADS_NUM"] = "1"
    environment["PYTHONUNBUFFERED"] = "1"  # output printed before a crash is not lost
    return environment


def _environment(method: str, folder: Path) -> dict[str, str]:
    """Make a minimal environment, without the folder from which this process was started.

    A user's own module is copied into `folder`, because its original folder may contain the truth.
    This prevents a method from reading the truth by accident; it does not stop one that searches
    the disk. Raises InputError.
    """
    environment = one_core_environment()
    module, colon, _ = method.partition(":")
    if colon and method not in METHODS:
        try:
            copy_sources(module, folder / SOURCES)
        except OSError as error:
            raise InputError(f"method '{method}' cannot be copied ({error})") from error
    return environment
