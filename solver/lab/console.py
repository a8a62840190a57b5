"""Terminal output: progress, the latest estimate, a table. All but the table goes to stderr."""

import math
import threading
from collections import Counter
from collections.abc import Iterator, Sequence, Sized
from contextlib import contextmanager, nullcontext
from pathlib import Path

from rich.console import Console
from rich.markup import escape
from rich.progress import MofNCompleteColumn, Progress
from rich.status import Status
from rich.table import Table

from solver.first_start import is_first_start
from solver.instrument.compiled import compiled_functions
from solver.instrument.errors import printable
from solver.instrument.estimate import Outcome
from solver.instrument.rig import Rig
from solver.lab.findings import Finding
from solver.lab.live import FrameResult
from solver.lab.shots import Source
from solver.lab.table import Row

console = Console(stderr=True, highlight=False, soft_wrap=True)

# Relative sigma of EI up to which it counts as learned. Chosen: twice what step 5 of the
# laboratory's page, a hung weight, reaches.
LEARNED_FORCE = 0.01
# Reasons that are shown. Chosen: some contain numbers and differ in each frame.
_MAX_REASONS = 6


@contextmanager
def setting_up(quiet: bool) -> Iterator[None]:
    """Show that the rig is calibrated and, at a first start, how many functions are compiled.

    Their total depends on the method and is not known beforehand.
    """
    if quiet or not is_first_start():
        with nullcontext() if quiet else console.status("calibrating"):
            yield
        return
    done = threading.Event()
    with Progress(
        *Progress.get_default_columns(), MofNCompleteColumn(), console=console
    ) as progress:
        task = progress.add_task("first start: compiling for half a minute to two", total=None)

        def follow() -> None:
            while not done.wait(0.5):
                progress.update(task, completed=len(compiled_functions() or ()))

        watcher = threading.Thread(target=follow, daemon=True)
        watcher.start()
        try:
            yield
        finally:
            done.set()
            watcher.join()
        count = len(compiled_functions() or ())
        progress.update(task, completed=count, total=count)


@contextmanager
def with_progress(
    given: Iterator[FrameResult], source: Source, quiet: bool
) -> Iterator[Iterator[FrameResult]]:
    """Pass the answers on and show progress: a bar, or for a camera the latest estimate."""
    if quiet:
        yield given
    elif source.live:
        with console.status("waiting for the camera; Ctrl-C stops") as status:
            yield _with_latest(given, status)
    else:
        assert isinstance(source, Sized)
        with Progress(
            *Progress.get_default_columns(), MofNCompleteColumn(), console=console
        ) as progress:
            yield iter(progress.track(given, total=len(source) or None, description="solving"))


def _with_latest(answers: Iterator[FrameResult], status: Status) -> Iterator[FrameResult]:
    for answer in answers:
        latency = f"{1e3 * answer.latency:.1f} ms"
        status.update(escape(f"{printable(answer.shot.name)}  {sentence(answer.row)}  {latency}"))
        yield answer


def table(rows: list[Row], method: str) -> Table:
    """Make a table of a method's estimates, with frames named by the shortest end of their path."""
    rich_table = Table(title=escape(method))
    columns = ("frame_id", "outcome", "x_c_mm", "x_c_sigma_mm", "force_n", "force_sigma_n")
    for column in (*columns, "image_ms"):
        # In two lines, all heads fit into a terminal of 80 characters.
        rich_table.add_column(column.replace("_sigma", "\n_sigma"))
    names = short_names([str(cells["frame_id"]) for cells in rows])
    for name, cells in zip(names, rows, strict=True):
        values = [cells[column] for column in (*columns[1:], "image_ms")]
        texts = (f"{v:.4g}" if isinstance(v, float) else str(v or "") for v in values)
        rich_table.add_row(escape(printable(name)), *texts)
    return rich_table


def reasons(rows: list[Row]) -> list[str]:
    """Say once why frames have no values, or what their values lack, with the number of frames."""
    usual = {outcome.sentence for outcome in Outcome}
    counts: Counter[str] = Counter(
        printable(str(cells["message"]) if _has_values(cells) else sentence(cells))
        for cells in rows
        if not _has_values(cells) or cells["message"] not in usual
    )
    lines = [
        f"{count} frame{'s' if count > 1 else ''}: {reason}"
        for reason, count in counts.most_common(_MAX_REASONS)
    ]
    more = len(counts) - len(lines)
    return [*lines, f"{more} more messages are in the table that is written"] if more else lines


def expected_accuracy(rows: list[Row], rig: Rig) -> list[str]:
    """Say how uncertain the forces are by EI alone, if a rig states no more than a drawing does.

    What is not learned yet is named, with the step of solver/README.md that learns it.
    """
    of_rigidity = rig.tolerances.flexural_rigidity / rig.beam.flexural_rigidity
    relative = math.hypot(of_rigidity, rig.shape.rigidity_sigma)
    if relative <= LEARNED_FORCE or all(cells["force_n"] is None for cells in rows):
        return []
    unknown = [
        *(["EI: step 5"] if of_rigidity > LEARNED_FORCE else []),
        *(["the beam: step 6"] if not rig.shape.is_learned and rig.shape.covariance.any() else []),
    ]
    remedy = f"; not learned yet: {', '.join(unknown)} of solver/README.md" if unknown else ""
    return [
        f"expect forces within {100 * relative:.2g} % (one sigma, of EI in rig.json){remedy}",
    ]


def show_findings(findings: Sequence[Finding], rig: Path) -> None:
    """Print what makes estimates wrong, and the command that reports on the rig at `rig`."""
    for finding in findings:
        console.print(f"warning: {printable(finding.message)}", markup=False)
    if findings:
        console.print(f"run python -m solver check --rig {printable(str(rig))}", markup=False)


def short_names(paths: list[str]) -> list[str]:
    """Shorten paths to the fewest last parts that keep all of them distinct."""
    parts = [Path(path).parts for path in paths]
    short = paths
    for depth in range(max(map(len, parts), default=0), 0, -1):
        shorter = ["/".join(part[-depth:]) for part in parts]
        if len(set(shorter)) < len(set(paths)):
            break
        short = shorter
    return short


def _has_values(cells: Row) -> bool:
    return cells["x_c_mm"] is not None or cells["force_n"] is not None


def sentence(cells: Row) -> str:
    """Summarise a row in a few words."""
    if not _has_values(cells):
        return f"{cells['outcome']}: {cells['message']}"
    values = (
        f"{name} {_with_sigma(cells[column], cells[sigma], scale)} {unit}"
        for name, column, sigma, scale, unit in (
            ("x_c", "x_c_mm", "x_c_sigma_mm", 1, "mm"),
            ("F", "force_n", "force_sigma_n", 1000, "mN"),
        )
        if cells[column] is not None
    )
    return f"{cells['outcome']}: {', '.join(values)}"


def _with_sigma(value: object, sigma: object, scale: float) -> str:
    assert isinstance(value, float)
    text = f"{scale * value:.4g}"
    return text if not isinstance(sigma, float) else f"{text} +- {scale * sigma:.2g}"
