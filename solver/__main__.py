"""`python -m solver OBSERVATIONS --method exact_fit`: images of a rig in, estimates out."""

import importlib
import statistics
import sys
import time
import traceback
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import track
from rich.table import Table

from solver.estimate import Antenna, estimate, set_up
from solver.instrument.errors import InputError
from solver.instrument.estimate import Estimate
from solver.instrument.files import write_text
from solver.instrument.observation import Frame, open_observations
from solver.methods import METHODS, Method
from solver.table import Row, csv_text, row

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)


@app.command()
def solve(
    observations: Annotated[Path, typer.Argument(help="folder with rig.json, images and frames")],
    method: Annotated[
        str, typer.Option(help=f"{', '.join(METHODS)}, or package.module:function")
    ] = "exact_fit",
    out: Annotated[
        Path | None, typer.Option(help="CSV to write [default: estimates_<method>.csv]")
    ] = None,
    repeats: Annotated[
        int, typer.Option(min=1, help="solve each frame this often and state the median time")
    ] = 1,
    quiet: Annotated[bool, typer.Option(help="no table, no progress")] = False,
) -> None:
    """Estimate contact and force in every frame; print a table and write it as CSV."""
    function = find_method(method)
    opened = open_observations(observations)
    antenna = set_up(opened)
    warm_up = opened.frames[0]
    estimate(antenna, warm_up.image(), function, warm_up.readings)
    console = Console(stderr=True)
    frames = track(opened.frames, "solving", console=console, disable=quiet)
    rows = [_solve_frame(antenna, frame, function, repeats) for frame in frames]
    target = out or Path(f"estimates_{method.replace(':', '.')}.csv")
    try:
        write_text(target, csv_text(rows))
    except OSError as error:
        raise InputError(f"{target}: cannot be written ({error.strerror})") from error
    if not quiet:
        Console().print(_table(rows, method))
        Console().print(f"{len(rows)} estimates in {target}")


def find_method(name: str) -> Method:
    """A method by its name in METHODS, or as package.module:function. Raises InputError."""
    if name in METHODS:
        return METHODS[name]
    module, colon, function = name.partition(":")
    if not (module and colon and function):
        raise InputError(
            f"method '{name}' is unknown, allowed is one of {', '.join(METHODS)}, "
            "or package.module:function"
        )
    try:
        found = getattr(importlib.import_module(module), function)
    except Exception as error:
        last = traceback.extract_tb(error.__traceback__)[-1]
        where = f"{Path(last.filename).name}:{last.lineno}"
        raise InputError(
            f"method '{name}' cannot be imported: {type(error).__name__} at {where}: {error}"
        ) from error
    if not callable(found):
        raise InputError(f"method '{name}' is a {type(found).__name__}, allowed is a function")
    method: Method = found
    return method


def _solve_frame(antenna: Antenna, frame: Frame, method: Method, repeats: int) -> Row:
    """One frame's row; the time runs from the image in memory to the estimate."""
    image = frame.image()
    times: list[float] = []
    answer: Estimate | None = None
    for _ in range(repeats):
        began = time.perf_counter()
        answer = estimate(antenna, image, method, frame.readings)
        times.append(time.perf_counter() - began)
    assert answer is not None
    return row(frame.frame_id, answer, 1e3 * statistics.median(times))


def _table(rows: list[Row], method: str) -> Table:
    table = Table(title=method)
    columns = ("frame_id", "outcome", "x_c_mm", "x_c_sigma_mm", "force_n", "force_sigma_n")
    for column in (*columns, "image_ms"):
        table.add_column(column)
    for cells in rows:
        shown = [cells[column] for column in (*columns, "image_ms")]
        table.add_row(*(f"{v:.4g}" if isinstance(v, float) else str(v or "") for v in shown))
    return table


def main() -> None:
    """Run; a mistake in the input is one sentence and exit status 2."""
    try:
        app(standalone_mode=True)
    except InputError as error:
        Console(stderr=True, highlight=False, soft_wrap=True).print(f"error: {error}", markup=False)
        sys.exit(2)


if __name__ == "__main__":
    main()
