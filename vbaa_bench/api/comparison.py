"""Comparison of scored runs with earlier ones."""

from pathlib import Path

from vbaa_bench.api.data import AnyDataset, dataset_folder
from vbaa_bench.regression.baseline import write_baseline
from vbaa_bench.regression.comparison import Comparison, pairs_of
from vbaa_bench.regression.comparison import compare as compare_pairs
from vbaa_bench.regression.scored_run import read_run


def save_baseline(run: AnyDataset, out: Path | str, *, why: str | None = None) -> list[str]:
    """Store the errors of every frame of a scored run in a JSON file; return its methods.

    `why` is the reason why an existing file is replaced; it is stored as well. Raises InputError
    without a reason, and for a baseline of another scene.

    >>> vb.save_baseline(data, "runs/baseline.json")
    ['two_point']
    """
    scored = read_run(dataset_folder(run))
    write_baseline(scored, Path(out), why)
    return scored.methods


def compare(run: AnyDataset, baseline: Path | str) -> Comparison:
    """Compare a scored run with its baseline: what became better or worse.

    A folder of baselines is compared with the runs of the same names in the folder `run`, as one
    table with one rate of false alarms. Results are `worse`, `better` and `not_distinguishable`.
    Raises InputError if nothing can be compared: a result of fewer than nine pushes cannot.

    >>> methods = vb.save_baseline(data, "runs/before.json")
    >>> vb.compare(data, "runs/before.json")
    Traceback (most recent call last):
    ...
    solver.instrument.errors.InputError: runs/before.json: nothing can be compared, every set of \
paired frames has fewer than nine pushes
    """
    return compare_pairs(pairs_of(dataset_folder(run), Path(baseline)))
