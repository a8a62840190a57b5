"""What changed since a baseline, and how the baseline itself changed."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from vbaa_bench.regression.baseline import Version, read_baseline, versions
from vbaa_bench.regression.comparison import Change, Comparison, RunAndBaseline, compare


@dataclass(frozen=True)
class Changes:
    """Comparison of a run with a baseline called `name`, and the baseline's versions, oldest first.

    Results that became worse come first, then better ones, then those that are the same.
    """

    name: str
    sentence: str
    notes: Sequence[str]
    results: Sequence[Change]
    history: Sequence[Version]

    @property
    def changed(self) -> list[Change]:
        """The results that became worse or better."""
        return [one for one in self.results if one.verdict != "same"]


def changes_since(baseline: Path, run: Path) -> Changes:
    """Compare a scored run with a baseline file. Raises InputError."""
    return changes_of(
        baseline.stem,
        compare([RunAndBaseline(run, baseline)]),
        versions(read_baseline(baseline)),
    )


def changes_of(name: str, comparison: Comparison, history: Sequence[Version]) -> Changes:
    """Order a comparison for a page."""
    same = [change for change in comparison.changes if change.verdict == "same"]
    return Changes(
        name,
        comparison.sentence,
        comparison.notes,
        [*comparison.worse, *comparison.better, *same],
        history,
    )
