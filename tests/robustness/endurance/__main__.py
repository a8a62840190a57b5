"""Long runs of `generate` that are disturbed:  python -m tests.robustness.endurance kills FOLDER

Other commands are disk, cluster, long and rigs.
"""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from solver.lab.command_end import run_command
from tests.robustness.endurance.cluster import check_installed, cluster_trials
from tests.robustness.endurance.disk import disk_trials
from tests.robustness.endurance.kills import VICTIMS, kill_runs
from tests.robustness.endurance.long_run import long_run, many_rigs
from vbaa_bench.cli.options import AsJson
from vbaa_bench.report.console import print_result, progress_bars
from vbaa_bench.scoring.tables import markdown_table

app = typer.Typer(
    no_args_is_help=True, help="Disturb long runs of `generate`, and compare what they complete."
)

Folder = Annotated[Path, typer.Argument(help="new folder for the datasets")]
Rounds = Annotated[int, typer.Option(min=1, help="number of trials of each kind")]
Seed = Annotated[int, typer.Option(min=0, help="seed of the random times")]


def _with_progress(title: str, measure: Callable[[Callable[[int, int], None]], Any]) -> Any:
    with progress_bars() as bars:
        task = bars.add_task(title, total=None)
        return measure(lambda done, total: bars.update(task, completed=done, total=total))


def _print(rows: Sequence[Mapping[str, Any]], passed: bool, as_json: bool) -> None:
    """Print rows as a Markdown table; exit with status 1 unless all is as it should be."""
    head = list(rows[0])
    lines = ([_text(row[name]) for name in head] for row in rows)
    table = markdown_table(head, lines, range(len(head)))
    print_result({"rows": list(rows), "passed": passed}, table, as_json)
    if not passed:
        raise typer.Exit(1)


def _text(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)


@app.command()
def kills(
    folder: Folder,
    kills: Annotated[int, typer.Option(min=1, help="number of kills")] = 200,
    seed: Seed = 0,
    as_json: AsJson = False,
) -> None:
    """Kill a child, the command or all its processes at random times, until runs complete.

    Every completed dataset is compared, byte by byte, with one that was never interrupted.
    """
    result = _with_progress("kills", lambda progress: kill_runs(kills, seed, folder, progress))
    rows = [{"killed": victim, "kills": result.kills[victim]} for victim in VICTIMS]
    passed = not (result.different or result.unfinished or result.orphans)
    summary = {
        "datasets completed": result.completed,
        "resumed": result.resumed,
        "different": "; ".join(result.different) or 0,
        "runs ended by the death of a child": "; ".join(result.unfinished) or 0,
        "children that outlived their parent": result.orphans,
        "kills after the end": result.too_late,
    }
    rows += [{"killed": name, "kills": value} for name, value in summary.items()]
    _print(rows, passed, as_json)


@app.command()
def disk(folder: Folder, rounds: Rounds = 5, seed: Seed = 0, as_json: AsJson = False) -> None:
    """Fill the disk, make it read-only, and start two commands in one folder.

    Needs Linux and root, because small file systems are mounted.
    """
    trials = _with_progress("trials", lambda progress: disk_trials(folder, rounds, seed, progress))
    passed = all(trial.refused and trial.identical for trial in trials)
    _print([trial._asdict() for trial in trials], passed, as_json)


@app.command()
def cluster(folder: Folder, rounds: Rounds = 3, seed: Seed = 0, as_json: AsJson = False) -> None:
    """Kill a worker, a machine and the scheduler of a Dask cluster on this machine.

    Every dataset is compared, byte by byte, with one of local processes.
    """
    check_installed()
    trials = _with_progress(
        "trials", lambda progress: cluster_trials(folder, rounds, seed, progress)
    )
    passed = all(
        not trial.different and trial.status == (trial.event == "poison frame") for trial in trials
    )
    _print([trial._asdict() for trial in trials], passed, as_json)


@app.command()
def long(
    folder: Folder,
    frames: Annotated[int, typer.Option(min=100, help="number of small images")] = 20_000,
    workers: Annotated[int, typer.Option(min=1, help="number of processes")] = 2,
    as_json: AsJson = False,
) -> None:
    """Measure rate and memory of a long run, in its first and last tenth."""
    run = _with_progress("frames", lambda progress: long_run(folder, frames, workers, progress))
    _print([run._asdict()], True, as_json)


@app.command()
def rigs(
    folder: Folder,
    count: Annotated[int, typer.Option("--rigs", min=40, help="number of small rigs")] = 300,
    workers: Annotated[int, typer.Option(min=1, help="number of processes")] = 2,
    as_json: AsJson = False,
) -> None:
    """Measure rate and memory of a run of many random rigs, in its first and last tenth."""
    run = _with_progress("rigs", lambda progress: many_rigs(folder, count, workers, progress))
    _print([run._asdict()], True, as_json)


if __name__ == "__main__":
    run_command(app)
