"""What the commands do with a scored dataset or a collection, by name."""

import contextlib
import functools
import io
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Final

from tests.robustness.fuzz.case import UnexpectedOutputError, control_characters
from tests.robustness.fuzz.datasets import copied
from vbaa_bench.dataset.collection import is_collection
from vbaa_bench.dataset.merge import merge as merge_parts
from vbaa_bench.regression.baseline import write_baseline
from vbaa_bench.regression.comparison import compare as compare_runs
from vbaa_bench.regression.comparison import pairs_of
from vbaa_bench.regression.scored_run import read_run
from vbaa_bench.report.console import show_scores
from vbaa_bench.report.report import report as write_report
from vbaa_bench.scoring.accuracy import accuracy
from vbaa_bench.scoring.results_layout import Results
from vbaa_bench.scoring.score import score as write_scores
from vbaa_bench.scoring.score import score_rigs, with_own
from vbaa_bench.scoring.tables import FORMATS, Shown


def score(root: Path, *predictions: Path) -> None:
    """Score a dataset, with predictions of an entrant, and print the table of scores.

    Raises UnexpectedOutputError if the table could control a terminal.
    """
    if is_collection(root):
        summary = score_rigs(root)
    else:
        summary = write_scores(Results(root), with_own(Results(root), predictions))
    output = io.StringIO()
    with contextlib.redirect_stdout(output):
        show_scores(summary, summary, as_json=False)
    if characters := control_characters(output.getvalue()):
        raise UnexpectedOutputError(f"the table of scores has the characters {characters!r}")


def report(root: Path, baseline: Path | None = None) -> None:
    """Write the report of a scored dataset or collection."""
    write_report(Results(root), baseline)


def table(root: Path, by: str | None = None, name: str = "markdown") -> None:
    """Format the table of accuracies. Raises UnexpectedOutputError as `score` does."""
    text = FORMATS[name](accuracy([root], by), Shown(by))
    if characters := control_characters(text):
        raise UnexpectedOutputError(f"the table has the characters {characters!r}")


def compare(root: Path, baseline: Path) -> None:
    """Compare a scored run with a baseline."""
    compare_runs(pairs_of(root, baseline)).records()


def store_baseline(root: Path, out: Path) -> None:
    """Write a scored run as a baseline, or as a new version of one."""
    write_baseline(read_run(root), out, "a test")


def merge(root: Path) -> None:
    """Copy a dataset or collection by merging its only part."""
    merge_parts([root], root.parent / "merged")


USES: Final[Mapping[str, Callable[[Path], None]]] = {
    "score": score,
    "report": report,
    "table": table,
    "merge": merge,
}


@functools.cache
def warm_up(material: Path) -> None:
    """Use valid data in all ways once: imports and compilation belong to no case."""
    with tempfile.TemporaryDirectory() as folder:
        root = copied(material / "dataset", Path(folder) / "data")
        score(root)
        report(root, material / "baseline.json")
        store_baseline(root, Path(folder) / "new.json")
