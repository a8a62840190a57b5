"""Solving of a dataset with methods, and scoring of their estimates."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any, Final

import polars as pl

from solver.instrument.errors import InputError, quoted, suggestion
from solver.instrument.observation import open_observations
from solver.methods import METHODS
from vbaa_bench.api.data import AnyDataset, dataset_folder
from vbaa_bench.dataset.collection import CollectionLayout, is_collection
from vbaa_bench.scoring.accuracy import accuracy
from vbaa_bench.scoring.isolation.runs import (
    MEMORY_GB,
    Job,
    MethodRun,
    RunSettings,
    applicable,
    solve_each,
    solve_rigs,
)
from vbaa_bench.scoring.results_layout import USUAL_CENTRELINE, Results, run_name
from vbaa_bench.scoring.score import read_scores, score_rigs, with_own
from vbaa_bench.scoring.score import score as write_scores
from vbaa_bench.scoring.tables import BRIEF, FORMATS, Shown
from vbaa_bench.workers.resources import cores

# Name that selects all methods of the solver.
_ALL_METHODS: Final = "all"


@dataclass(frozen=True)
class AccuracyTable:
    """Scores of several datasets as one table.

    `rows` hold all statistics by name: a row for each dataset and method, split by a condition
    `by`, if any, and rows of the information limits where they were computed.
    """

    rows: list[dict[str, Any]]
    by: str | None

    def frame(self) -> pl.DataFrame:
        """Return the statistics that are numbers or texts, one row per row."""
        return pl.DataFrame(
            [
                {name: value for name, value in row.items() if not isinstance(value, dict)}
                for row in self.rows
            ],
            infer_schema_length=None,
        )

    def of(self, methods: Sequence[str]) -> "AccuracyTable":
        """Return the table with these methods only, and the limits. Raises InputError."""
        known = [str(row["method"]) for row in self.rows]
        _check_names("method", methods, known)
        kept = [row for row in self.rows if row["method"] in methods or not row["outcomes"]]
        return replace(self, rows=kept)

    def text(
        self,
        form: str = "markdown",
        *,
        brief: bool = False,
        columns: Sequence[str] = (),
        bold: bool = False,
    ) -> str:
        """Write the table as "markdown", "latex" (with booktabs) or "csv".

        `columns` are names of figures, as the CSV has them. A brief table has errors of x_c, force
        and psi, bound, coverage and time. `bold` marks the smallest errors and times of a scene.
        Raises InputError.
        """
        if form not in FORMATS:
            raise InputError(f"--format is {form}, allowed is one of {', '.join(FORMATS)}")
        figures = [
            name for name, value in self.rows[0].items() if not isinstance(value, dict | str)
        ]
        _check_names("column", columns, figures)
        chosen = columns or (BRIEF if brief else None)
        return FORMATS[form](self.rows, Shown(self.by, chosen, bold))


def _check_names(what: str, names: Sequence[str], known: Sequence[str]) -> None:
    """Raise InputError for the first name that is not known."""
    for name in names:
        if name not in known:
            raise InputError(f"{what} {quoted(name)} is unknown; {suggestion(name, known)}")


def table(datasets: Sequence[AnyDataset] | AnyDataset, by: str | None = None) -> AccuracyTable:
    """Collect the scores of one or several scored datasets in one table.

    `by` splits them by a condition, as `vbaa-bench table --by` does. Raises InputError for a
    dataset that is not scored, and for an unknown condition.

    >>> vb.table(data).frame()["method", "n"].rows()
    [('two_point', 4)]
    >>> print(vb.table([data, data], by="deflection_pct").text("csv", brief=True)[:29])
    scene,deflection_pct,method,n
    """
    several = [datasets] if isinstance(datasets, AnyDataset) else datasets
    return AccuracyTable(accuracy([dataset_folder(one) for one in several], by), by)


@dataclass(frozen=True)
class Scores:
    """The scores of a dataset, also in its folder `scores/`.

    `summary` holds the scores of every method by name, and messages in `warnings`; `runs` holds the
    scored runs by name, as returned by `solve`.
    """

    root: Path
    summary: dict[str, Any]
    runs: Mapping[str, MethodRun]

    @property
    def frames(self) -> pl.DataFrame:
        """Errors and outcomes, one row for each method and frame."""
        return read_scores(Results(self.root))

    def table(self, by: str | None = None) -> pl.DataFrame:
        """Return one row per method; with `by`, one row for each value of a condition.

        Conditions are those of `vbaa-bench table --by`. Raises InputError for an unknown one.
        """
        return table(self.root, by).frame()

    def _repr_html_(self) -> str:
        return self.table()._repr_html_()


def solve(
    data: AnyDataset,
    methods: Sequence[str] | str | None = None,
    *,
    centrelines: Sequence[str] = (USUAL_CENTRELINE,),
    repeats: int = 3,
    memory_gb: float = MEMORY_GB,
    on_start: Callable[[str], None] = lambda _name: None,
    on_output: Callable[[str], None] = lambda _line: None,
    on_rig: Callable[[], None] = lambda: None,
) -> dict[str, MethodRun]:
    """Run methods on the observations of a dataset, each in a process that never sees the truth.

    Of a collection, all rigs are solved, and `on_rig` is called after each.

    `methods` are names, "all", or "package.module:function", one or several; by default those that
    the dataset has readings for. Their estimates are written to the folder `predictions/`. Each
    frame is solved `repeats` times, and the median time is reported. `on_start` is called with the
    name of each run before it starts, or with those of all runs that share the set-up of a
    collection's rigs, `on_output` with each line that a method prints.

    Returns the runs by name: a method, or "method@centreline" if the centreline is not the default
    one. Raises InputError.
    """
    results = Results(dataset_folder(data))
    rigs = CollectionLayout(results.root).rigs() if is_collection(results.root) else {}
    if is_collection(results.root) and not rigs:
        raise InputError(f"{results.root}: holds no complete rig; generate the collection first")
    requested = [methods] if isinstance(methods, str) else methods
    first = next(iter(rigs.values()), results.dataset)
    requested = requested or applicable(open_observations(first.observations))
    chosen = dict.fromkeys(
        name for entry in requested for name in (METHODS if entry == _ALL_METHODS else [entry])
    )
    # Methods of the solver share a set-up; each of the user's own has its own process.
    groups = [[name for name in chosen if name in METHODS]]
    groups += [[name] for name in chosen if name not in METHODS]
    runs: dict[str, MethodRun] = {}
    for group, centreline in product(filter(None, groups), dict.fromkeys(centrelines)):
        named = {run_name(method, centreline): method for method in group}
        settings = RunSettings(centreline, repeats, memory_gb)
        if rigs:
            on_start(", ".join(named))
            runs |= solve_rigs(rigs, named, settings, cores(), on_rig, on_output)
            continue
        jobs = [
            Job(method, results.dataset, results.predictions / f"{name}.csv")
            for name, method in named.items()
        ]
        with closing(solve_each(jobs, settings, on_output)) as solved:
            for name in named:
                on_start(name)
                runs[name] = run = next(solved)
                if run.traceback:
                    on_output(f"{name}: first of {run.crashed} crashes:\n{run.traceback}")
    return runs


def score(
    data: AnyDataset,
    methods: Sequence[str] | str | None = None,
    *,
    runs: Mapping[str, MethodRun] | None = None,
    predictions: Sequence[Path | str] = (),
) -> Scores:
    """Score methods against the truth of a dataset, and write the folder `scores/`.

    With `methods`, names as for `solve`, these are run first and only they are scored. With `runs`,
    as returned by `solve`, those are scored. Without either, everything in the folder
    `predictions/` is scored. Your own files, `predictions`, are scored in addition: CSV or Parquet
    tables with `frame_id` and `x_c_mm` or `force_n`.

    Raises InputError if there is nothing to score, and for damaged files.
    """
    root = dataset_folder(data)
    if methods is not None:
        runs = {**(runs or {}), **solve(data, methods)}
    if is_collection(root):
        if predictions:
            raise InputError(f"{root}: is a collection; predictions files are scored rig by rig")
        return Scores(root, score_rigs(root, None if runs is None else list(runs)), runs or {})
    user_files = [Path(path) for path in predictions]
    tables = with_own(Results(root), user_files)
    if runs is not None:
        chosen = {*runs, *(path.stem for path in user_files)}
        tables = {name: path for name, path in tables.items() if name in chosen}
    return Scores(root, write_scores(Results(root), tables), runs or {})
