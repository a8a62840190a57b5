"""Faults of the results of a dataset or collection, and the commands that compute them again."""

from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Final, NamedTuple

import polars as pl

from solver.instrument.files import read_regular
from solver.instrument.hashes import HASHES, digest
from vbaa_bench.dataset.derived import LIMITS, truth_of_limits
from vbaa_bench.dataset.faults import (
    DAMAGED,
    UNRECORDED,
    Fault,
    file_fault,
    missing,
    read_hash_table,
    surplus,
)
from vbaa_bench.dataset.layout import Layout

PREDICTIONS: Final = "predictions"
# Suffixes of a user's own predictions, which need no record.
_OWN: Final = {".csv", ".parquet"}


class ResultFolder(NamedTuple):
    """A folder of results and the command that writes them."""

    folder: str
    command: str


RESULTS: Final = (
    ResultFolder("derived", "limits"),
    ResultFolder(PREDICTIONS, "solve"),
    ResultFolder("scores", "score"),
    ResultFolder("report", "report"),
)


def remedy(root: Path, path: Path) -> str | None:
    """Name the command that computes a file of results again; None for other files."""
    try:
        folder, name = path.relative_to(root).parts[:2]
    except ValueError:
        return None
    command = {one.folder: one.command for one in RESULTS}.get(folder)
    if command is None:
        return None
    options = _options(name) if folder == PREDICTIONS and name != HASHES else ""
    return f"vbaa-bench {'budget' if name == 'budget.json' else command} {root}{options}"


def _options(name: str) -> str:
    """Return the options of `solve` that write a predictions file."""
    method, _, centreline = Path(name).stem.partition("@")
    module, dot, function = method.rpartition(".")
    options = f" --method {module}:{function}" if dot else f" --method {method}"
    return f"{options} --centreline {centreline}" if centreline else options


def result_faults(root: Path, methods: Collection[str]) -> Iterator[Fault]:
    """Compare all files of results with the hashes of their folders.

    `methods` are the names of the solver's methods, whose predictions must be recorded.
    """
    for results in RESULTS:
        folder = root / results.folder
        if folder.is_dir():
            yield from _folder_faults(folder, methods)
    yield from _limits_of_another_truth(root)


def _folder_faults(folder: Path, methods: Collection[str]) -> Iterator[Fault]:
    names = {path.name for path in folder.iterdir()}
    table = read_hash_table(folder)
    hashes = table.hashes or {}
    ours = {name for name in names if not _is_own(folder, name, methods)} - {HASHES}
    if table.fault is not None and (HASHES in names or ours):
        yield table.fault
    for name, recorded in sorted(hashes.items()):
        fault = file_fault(folder / name, recorded)
        if fault is not None:
            yield fault if name in names else missing(folder / name)
    for name in sorted(ours - hashes.keys()):
        if folder.name == PREDICTIONS and Path(name).suffix in _OWN:
            yield Fault(folder / name, UNRECORDED, "has no recorded sha256")
        elif table.hashes is not None:
            yield surplus(folder / name)


def _is_own(folder: Path, name: str, methods: Collection[str]) -> bool:
    """Test whether a file may be a user's own predictions, which need no record."""
    path = Path(name)
    solved = "." in path.stem or path.stem.partition("@")[0] in methods
    return folder.name == PREDICTIONS and path.suffix in _OWN and not solved


def _limits_of_another_truth(root: Path) -> Iterator[Fault]:
    layout = Layout(root)
    path = layout.derived / LIMITS
    try:
        recorded = truth_of_limits(read_regular(path))
        current = digest(read_regular(layout.truth / HASHES))
    except (OSError, pl.exceptions.PolarsError, pl.exceptions.PanicException):
        return  # reported with the other files
    if recorded != current:
        yield Fault(path, DAMAGED, "was computed from another truth")
