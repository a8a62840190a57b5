"""The leaderboard as one HTML page that needs no network, and as CSV tables."""

import csv
import io
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from solver.instrument.files import write_text
from solver.lab.protocol_score import Score
from vbaa_bench.dataset.lock import writing
from vbaa_bench.report.numbers import short
from vbaa_bench.report.template import template
from vbaa_bench.suite.figures import ERROR, FIGURES
from vbaa_bench.suite.folder import SuiteFolder
from vbaa_bench.suite.leaderboard import Place, TrackTable, Value, submissions_of
from vbaa_bench.suite.real import ScoredSet

PAGE: Final = "leaderboard.html"
TABLE: Final = "leaderboard.csv"
REAL_TABLE: Final = "real.csv"
# Names of the quantities of real sets, with the units of their errors.
QUANTITIES: Final = {
    "x_c_mm": "x_c, % of L",
    "s_c_mm": "s_c, % of L",
    "force_n": "force, % of the value",
}


def write_leaderboard(
    folder: SuiteFolder, tables: Sequence[TrackTable], sets: Sequence[ScoredSet]
) -> Path:
    """Write the page and the tables into the folder; return the path of the page.

    The table of real sets is removed if there are none. Raises InputError.
    """
    with writing(folder.root):
        write_text(folder.root / TABLE, leaderboard_csv(folder, tables))
        if sets:
            write_text(folder.root / REAL_TABLE, real_csv(sets))
        else:
            (folder.root / REAL_TABLE).unlink(missing_ok=True)
        write_text(folder.root / PAGE, leaderboard_page(folder, tables, sets))
    return folder.root / PAGE


def leaderboard_page(
    folder: SuiteFolder, tables: Sequence[TrackTable], sets: Sequence[ScoredSet]
) -> str:
    """Write the page."""
    suite = folder.suite.content
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
        sets=sets,
        quantities=QUANTITIES,
        figures={name: FIGURES[name] for name in suite.metrics},
        submissions={one.name: one for one in submissions_of(folder)},
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


def real_csv(sets: Sequence[ScoredSet]) -> str:
    """Write one row per set, load, quantity and method, with all figures in full precision."""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(["set", "sha256", "method", *Score._fields])
    for one in sets:
        for method, score in one.scores:
            writer.writerow([one.name, one.sha256, method, *score])
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
