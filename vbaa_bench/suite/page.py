"""The leaderboard as one HTML page that needs no network, and as a CSV table."""

import csv
import io
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from solver.instrument.files import write_text
from vbaa_bench.dataset.lock import writing
from vbaa_bench.report.numbers import short
from vbaa_bench.report.template import template
from vbaa_bench.suite.figures import ERROR, FIGURES
from vbaa_bench.suite.folder import SuiteFolder
from vbaa_bench.suite.leaderboard import Place, TrackTable, Value

PAGE: Final = "leaderboard.html"
TABLE: Final = "leaderboard.csv"


def write_leaderboard(folder: SuiteFolder, tables: Sequence[TrackTable]) -> Path:
    """Write the page and the table into the folder; return the path of the page.

    Raises InputError.
    """
    with writing(folder.root):
        write_text(folder.root / TABLE, leaderboard_csv(folder, tables))
        write_text(folder.root / PAGE, leaderboard_page(folder, tables))
    return folder.root / PAGE


def leaderboard_page(folder: SuiteFolder, tables: Sequence[TrackTable]) -> str:
    """Write the page."""
    suite = folder.suite.content
    submissions = {
        place.method: place.submission
        for table in tables
        for place in table.places
        if place.submission is not None
    }
    fresh = {place.method for table in tables for place in table.places if place.fresh}
    return template("report/leaderboard.html.jinja").render(
        suite=suite,
        digest=folder.suite.sha256,
        rules={
            name: value
            for name, value in suite.rules.model_dump().items()
            if isinstance(value, str)
        },
        tables=tables,
        figures={name: FIGURES[name] for name in suite.metrics},
        submissions=submissions,
        fresh=fresh,
        fresh_seed=folder.fresh_seed,
        text=value_text,
    )


def leaderboard_csv(folder: SuiteFolder, tables: Sequence[TrackTable]) -> str:
    """Write one row per track and method, with all figures in full precision."""
    metrics = folder.suite.content.metrics
    heads = ["track", "rank", "method", "kind", "datasets", "datasets_of_track", "time_rank"]
    heads += [f"{name}{end}" for name in metrics for end in ("", "_low", "_high")]
    heads += [f"fresh_{ERROR}{end}" for end in ("", "_low", "_high")]
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(heads)
    for table in tables:
        for place in table.places:
            writer.writerow(_cells(table, place, metrics))
    return stream.getvalue()


def _cells(table: TrackTable, place: Place, metrics: Sequence[str]) -> list[object]:
    cells: list[object] = [table.name, place.rank, place.method, place.kind, place.datasets]
    cells += [len(table.scored) + len(table.missing), place.time_rank]
    for value in (*(place.figures[name] for name in metrics), place.fresh or Value(None, None)):
        cells += [value.value, *(value.interval or (None, None))]
    return cells


def value_text(value: Value) -> str:
    """Format a value with its interval, such as `0.0092 (0.0081–0.011)`."""
    if value.value is None or value.interval is None:
        return short(value.value)
    return f"{short(value.value)} ({short(value.interval.low)}–{short(value.interval.high)})"
