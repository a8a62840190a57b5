"""Output of commands: progress and remarks on stderr, results on stdout, as text or JSON."""

import json
from collections.abc import Callable, Iterable, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any, Final

from rich import box
from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.table import Table
from rich.text import Text

from solver.instrument.errors import printable

console = Console(stderr=True, highlight=False)

# Figures of the small table of scores, followed by the number of frames.
_SCORES: Final = (
    "x_c_median_abs_pct_L",
    "x_c_rmse_pct_L",
    "x_c_rmse_all_pct_L",
    "force_rmse_pct",
    "failure_rate",
    "ms_per_frame_median",
)


def print_result(record: dict[str, Any], sentence: str, as_json: bool) -> None:
    """Print a record as one JSON object, or the sentence that describes it."""
    if as_json:
        print(json.dumps(record))
    else:
        Console(soft_wrap=True).print(printable(sentence), highlight=False, markup=False)


def print_line(line: str) -> None:
    """Print a line, such as of a method's output, beside a spinner.

    Characters that would control the terminal are escaped.
    """
    console.print(printable(line.expandtabs()), markup=False, emoji=False, soft_wrap=True)


def progress_bars(*, shown: bool = True) -> Progress:
    """Return progress bars with elapsed and remaining time."""
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
        console=console,
        disable=not shown,
    )


def progress_bar(bars: Progress, name: str, *, hidden: bool = False) -> Callable[[int, int], None]:
    """Add a bar, which may be hidden until it moves; return a function of `done` and `total`."""
    task = bars.add_task(name, total=None, visible=not hidden)

    def move(done: int, total: int) -> None:
        bars.update(task, completed=done, total=total, visible=True)

    return move


def late_bars(shown: ExitStack, steps: Sequence[str]) -> Callable[[str, int, int], None]:
    """Return a function that shows the progress of steps; bars appear when the first has begun.

    A mistake that is detected earlier has one sentence and no bars.
    """
    bars: dict[str, Callable[[int, int], None]] = {}

    def progress(step: str, done: int, total: int) -> None:
        if not bars:
            shown_bars = shown.enter_context(progress_bars())
            bars.update({name: progress_bar(shown_bars, name) for name in steps})
        bars[step](done, total)

    return progress


def show_table(title: str, heads: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    """Print a table, never cut to the width of the terminal; its first column holds names."""
    table = Table(title=title, title_justify="left", box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    lines = list(rows)
    widths = []
    for index, head in enumerate(heads):
        # Numbers and the words of heads are never wrapped; names are wrapped at 26 characters.
        widest = max(map(len, [*(line[index] for line in lines), *head.split()]))
        widths.append(widest if index else max(min(widest, 26), len(head)))
        table.add_column(
            head,
            justify="right" if index else "left",
            overflow="fold",
            width=widths[index],
        )
    for line in lines:
        table.add_row(*(Text(printable(cell)) for cell in line))
    # Rich would cut a table wider than the terminal, or than 80 columns in a pipe. The box takes
    # one column on either side; padding and a divider take one each beside every table column.
    needed = sum(widths) + 2 * len(widths) + 2
    terminal = Console()
    Console(width=max(terminal.width, needed)).print(table)


def show_scores(summary: dict[str, Any], record: dict[str, Any], as_json: bool) -> None:
    """Print the small table of scores, or the record as JSON."""
    if as_json:
        print_result(record, "", True)
        return
    from vbaa_bench.scoring.statistics import SUMMARY  # late: most commands need no tables

    rows = []
    for name, values in summary["methods"].items():
        # A rate is shown in per cent.
        numbers = [values[key] if key != "failure_rate" else 100 * values[key] for key in _SCORES]
        cells = ("–" if value is None else f"{value:.3g}" for value in numbers)
        rows.append((name, *cells, str(values["n"])))
    heads = [SUMMARY[key].heading.report for key in (*_SCORES, "n")]
    show_table("scores", ("method", *heads), rows)
    for name, values in summary["methods"].items():
        for quantity, share in values["efficiency"].items():
            if quantity == "x_c_mm" or share["impossible"]:
                print(f"{name} {share['sentence']}")


def outcomes(table: Path) -> str:
    """Count the outcomes in a predictions file, with the first message of each failure."""
    import polars as pl  # imported late: only methods' commands need tables

    from solver.instrument.estimate import Outcome
    from vbaa_bench.scoring.predictions import read_predictions

    rows = read_predictions(table).group_by("outcome").agg(pl.len(), pl.col("message").first())
    parts = [
        f"{count} {outcome}" + ("" if outcome == Outcome.CONTACT else f" ({message})")
        for outcome, count, message in rows.sort("len", descending=True).iter_rows()
    ]
    return ", ".join(parts)
