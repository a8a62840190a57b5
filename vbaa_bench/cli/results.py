"""Commands that solve and score: run, solve, score, report, table."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console
from rich.markup import escape

from vbaa_bench.cli.data import SceneChoice, exit_if_incomplete, generate_dataset
from vbaa_bench.cli.interrupt import importing
from vbaa_bench.cli.limits import store_limits
from vbaa_bench.cli.options import (
    MEMORY_GB,
    AsJson,
    By,
    Centreline,
    Dask,
    DatasetPath,
    Fork,
    FrameCount,
    Memory,
    Method,
    Modules,
    Out,
    Predictions,
    Repeats,
    Rigs,
    ScenePath,
    Seed,
    Settings,
    Variant,
    Workers,
)
from vbaa_bench.report.console import console, outcomes, print_line, print_result, show_scores
from vbaa_bench.scoring.results_layout import USUAL_CENTRELINE

if TYPE_CHECKING:
    from vbaa_bench.scoring.isolation.runs import MethodRun


def run(
    scene: ScenePath,
    out: Out = None,
    method: Method = None,
    centreline: Centreline = None,
    seed: Seed = None,
    settings: Settings = None,
    _module: Modules = None,
    frames: FrameCount = None,
    rigs: Rigs = None,
    fork: Fork = False,
    dask: Dask = None,
    workers: Workers = None,
    variant: Variant = None,
    repeats: Repeats = 3,
    memory: Memory = MEMORY_GB,
    limits: Annotated[
        bool, typer.Option(help="compute the information limit of every frame")
    ] = True,
    as_json: AsJson = False,
) -> None:
    """Generate, solve, score and report a scene, with the information limits of its frames."""
    choice = SceneChoice(scene, seed, settings, frames, rigs, fork=fork, dask=dask)
    root, counts, _ = generate_dataset(choice, out, workers, variant)
    if limits:
        store_limits(root, workers, variant)
    runs = solve_dataset(root, method, centreline, repeats, memory)
    with importing():
        from vbaa_bench.api import results

    summary = results.score(root, runs=runs).summary
    _warn(summary)
    page = _report(root)
    show_scores(summary, {"report": str(page), **summary}, as_json)
    if not as_json:
        for name, method_run in runs.items():
            if summary["methods"][name]["failure_rate"] == 1:
                console.print(
                    f"{name} estimates no frame: {outcomes(method_run.table)}", markup=False
                )
        Console(soft_wrap=True).print(f"report: {page}", highlight=False, markup=False)
    _exit_if_all_crashed(runs)
    exit_if_incomplete(counts)


def solve(
    dataset: DatasetPath,
    method: Method = None,
    centreline: Centreline = None,
    repeats: Repeats = 3,
    memory: Memory = MEMORY_GB,
    as_json: AsJson = False,
) -> None:
    """Run methods on a dataset's observations, each in a process without access to the truth."""
    runs = solve_dataset(dataset, method, centreline, repeats, memory)
    record = {"predictions": {name: str(method_run.table) for name, method_run in runs.items()}}
    lines = [f"{method_run.table}: {outcomes(method_run.table)}" for method_run in runs.values()]
    print_result(record, "\n".join(lines), as_json)
    _exit_if_all_crashed(runs)


def score(dataset: DatasetPath, predictions: Predictions = None, as_json: AsJson = False) -> None:
    """Score all solved methods and your own predictions, which are copied to the dataset."""
    with importing():
        from vbaa_bench.api import results

    summary = results.score(dataset, predictions=predictions or ()).summary
    _warn(summary)
    show_scores(summary, summary, as_json)


def report(
    dataset: DatasetPath,
    baseline: Annotated[
        Path | None, typer.Option(help="baseline file; the report shows what changed since")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Write the HTML report of a scored dataset."""
    page = _report(dataset, baseline)
    print_result({"report": str(page)}, str(page), as_json)


def table(
    datasets: Annotated[list[Path], typer.Argument(help="folders of scored datasets")],
    by: By = None,
    table_format: Annotated[
        str, typer.Option("--format", help="markdown; latex, with booktabs; or csv")
    ] = "markdown",
    brief: Annotated[
        bool, typer.Option("--brief", help="errors of x_c, force and psi, bound, coverage, time")
    ] = False,
    column: Annotated[
        list[str] | None,
        typer.Option("--column", help="figure to show, by its name in the CSV; repeatable"),
    ] = None,
    method: Annotated[
        list[str] | None, typer.Option("--method", "-m", help="method to show; repeatable")
    ] = None,
    bold: Annotated[
        bool, typer.Option("--bold", help="smallest error and time of a scene in bold")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Print the scores of several datasets as one table, with the bound if limits were computed."""
    with importing():
        from vbaa_bench.api import results

    made = results.table(datasets, by)
    if method:
        made = made.of(method)
    if as_json:
        print_result({"rows": made.rows}, "", True)
    else:
        print(made.text(table_format, brief=brief, columns=column or (), bold=bold))


def solve_dataset(
    root: Path,
    methods: list[str] | None,
    centrelines: list[str] | None,
    repeats: int,
    memory: float,
) -> "dict[str, MethodRun]":
    """Run methods on a dataset with a line of progress; return their runs by name."""
    with importing():
        from vbaa_bench.api import results

    with console.status("solving") as status:
        name, rigs = "", 0

        def on_start(started: str) -> None:
            nonlocal name, rigs
            name, rigs = started, 0
            status.update(escape(f"solving with {name}"))

        def on_rig() -> None:
            nonlocal rigs
            rigs += 1
            status.update(escape(f"solving with {name}, {rigs} rigs"))

        return results.solve(
            root,
            methods,
            centrelines=centrelines or [USUAL_CENTRELINE],
            repeats=repeats,
            memory_gb=memory,
            on_start=on_start,
            on_output=print_line,
            on_rig=on_rig,
        )


def _report(root: Path, baseline: Path | None = None) -> Path:
    with importing():
        from vbaa_bench.api.views import write_report

    return write_report(root, baseline=baseline)


def _warn(summary: Mapping[str, Any]) -> None:
    for warning in summary["warnings"]:
        print_line(f"warning: {warning}")


def _exit_if_all_crashed(runs: "Mapping[str, MethodRun]") -> None:
    """Exit with status 1 if a method crashed on every frame."""
    if any(method_run.crashed == method_run.frames for method_run in runs.values()):
        raise typer.Exit(1)
