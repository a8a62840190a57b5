"""What changed since a baseline, and how the baseline itself changed."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import get_args

from vbaa_bench.regression.baseline import Version, read_baseline, versions
from vbaa_bench.regression.comparison import Change, Comparison, RunAndBaseline, Verdict, compare


@dataclass(frozen=True)
class Changes:
    """Comparison of a run with a baseline called `name`, and the baseline's versions, oldest first.

    Results that became worse come first, then better ones, then those that are not distinguishable,
    then those that are the same. `reported` are the first of them that a reader must see: without
    strata that are not distinguishable.
    """

    name: str
    sentence: str
    notes: Sequence[str]
    reported: Sequence[Change]
    results: Sequence[Change]
    history: Sequence[Version]


def changes_since(baseline: Path, run: Path) -> Changes:
    """Compare a scored run with a baseline file. Raises InputError."""
    return changes_of(
        baseline.stem,
        compare([RunAndBaseline(run, baseline)]),
        versions(read_baseline(baseline)),
    )


def changes_of(name: str, comparison: Comparison, history: Sequence[Version]) -> Changes:
    """Order a comparison for a page."""
    order = get_args(Verdict)
    return Changes(
        name,
        comparison.sentence,
        comparison.notes,
        comparison.reported,
        sorted(comparison.changes, key=lambda change: order.index(change.verdict)),
        history,
    )
