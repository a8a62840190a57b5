"""Count false alarms of comparisons, and how often they find changes that are known.

Every pair of several runs of one scene with unchanged methods is compared. Changes are then made on
purpose, one method at a time: errors of the same images are multiplied by 1.02, and times of the
other run of each pair by 1.3.
"""

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations
from pathlib import Path
from typing import Any, Final

import polars as pl

from solver.instrument.errors import InputError
from vbaa_bench.dataset.collection import is_collection
from vbaa_bench.regression.baseline import check_same_scene
from vbaa_bench.regression.cells import PairedScene
from vbaa_bench.regression.compared import COMPARED, TIME
from vbaa_bench.regression.comparison import Comparison, table
from vbaa_bench.regression.scored_run import ScoredRun, pair, read_run

WORSE: Final = 1.02
SLOWER: Final = 1.3

Record = dict[str, Any]
HEADS: Final = ("comparison", "comparisons", "reported")
_ERRORS: Final = [quantity.column for quantity in COMPARED if "_error_" in quantity.column]


def measure(roots: Sequence[Path]) -> Record:
    """Compare every pair of scored runs, and each run with worse or slower versions of itself.

    Raises InputError for runs of different scenes, and for fewer than two.
    """
    if len(roots) < 2:
        raise InputError("alarms needs at least two runs")
    runs = [read_run(root) for root in roots]
    for root, run in zip(roots[1:], runs[1:], strict=True):
        check_same_scene(runs[0], run, root)
    rigs = is_collection(roots[0])
    pairs = list(combinations(runs, 2))
    unchanged = [_compare(old, new, rigs) for old, new in pairs]
    timed = runs[0].frames[TIME.column].is_not_null().any()
    return {
        "title": runs[0].title,
        "runs": len(runs),
        "pushes": runs[0].frames["push_id"].n_unique(),
        "methods": runs[0].methods,
        "different_images": len({run.images for run in runs}),
        "unchanged": _count([bool(one.worse or one.better) for one in unchanged]),
        "2_pct_worse": _count(
            [
                _finds(_compare(run, _multiplied(run, name, _ERRORS, WORSE), rigs), name)
                for run in runs
                for name in run.methods
            ]
        ),
        "30_pct_slower": _count(
            [
                _finds(_compare(old, _multiplied(new, name, [TIME.column], SLOWER), rigs), name)
                for old, new in pairs
                for name in new.methods
                if timed
            ]
        ),
    }


def lines(record: Record) -> list[tuple[str, ...]]:
    """Format a record as rows of a table."""
    labels = {
        "unchanged": "unchanged methods, all pairs of runs",
        "2_pct_worse": "a method with errors 2 % larger, same images",
        "30_pct_slower": "a method 30 % slower, all pairs of runs",
    }
    return [
        (label, str(record[key]["comparisons"]), str(record[key]["reported"]))
        for key, label in labels.items()
    ]


def _compare(old: ScoredRun, new: ScoredRun, rigs: bool) -> Comparison:
    scene = PairedScene(
        old.title,
        pair(old, new, Path(old.title)),
        same_images=old.images == new.images,
        same_processor=old.processor == new.processor,
        rigs=rigs,
    )
    return table({old.title: scene})


def _multiplied(run: ScoredRun, method: str, columns: Sequence[str], factor: float) -> ScoredRun:
    """Multiply some results of a method by a factor."""
    changed = pl.when(method=method).then(pl.col(columns) * factor).otherwise(pl.col(columns))
    return replace(run, frames=run.frames.with_columns(changed))


def _finds(comparison: Comparison, method: str) -> bool:
    """Test whether a comparison reports this method, and only this one, as worse."""
    return {change.method for change in comparison.worse} == {method}


def _count(reported: Sequence[bool]) -> Record:
    return {"comparisons": len(reported), "reported": sum(reported)}
