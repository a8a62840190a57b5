"""The command suite: run, verify, check and rank."""

from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from solver.instrument.errors import InputError
from solver.lab.help import Command, Group
from vbaa_bench.cli.interrupt import importing
from vbaa_bench.cli.options import AsJson, Method, Variant, Workers, checked_path, checked_paths
from vbaa_bench.report.console import (
    console,
    late_bars,
    print_line,
    print_result,
    show_table,
)

suite = typer.Typer(cls=Group, no_args_is_help=True)

Tracks = Annotated[
    list[str] | None, typer.Option("--track", help="track; repeatable", show_default="all")
]
SuiteFolderPath = Annotated[
    Path, typer.Argument(callback=checked_path, help="folder of a suite, from suite run")
]


@suite.command(cls=Command, epilog="Example: vbaa-bench suite run 1.0 --track lite")
def run(
    name: Annotated[str, typer.Argument(help="version of a suite, such as 1.0, or its file")],
    track: Tracks = None,
    method: Method = None,
    submission: Annotated[
        list[Path] | None,
        typer.Option(
            callback=checked_paths, help="folder of a submission to run as well; repeatable"
        ),
    ] = None,
    real: Annotated[
        list[Path] | None,
        typer.Option(
            callback=checked_paths,
            help="folder of real images with known loads to score (docs/protocol.md); without "
            "--track, nothing else is run; repeatable",
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            callback=checked_path, help="folder to write", show_default="runs/suite_<version>"
        ),
    ] = None,
    fresh: Annotated[
        bool, typer.Option(help="run submissions with code on a fresh seed, too")
    ] = True,
    workers: Workers = None,
    variant: Variant = None,
    as_json: AsJson = False,
) -> None:
    """Generate, solve and score the datasets of a suite. Run it again to continue.

    The information limits of all frames are computed as well. Datasets, limits and predictions
    that exist are kept; real sets are solved again. The exit status is 1 if frames failed.
    """
    with importing():
        from vbaa_bench.suite.folder import create_folder
        from vbaa_bench.suite.run import Request, run_suite

    root = out or Path("runs") / f"suite_{Path(name).stem if name.endswith('.yaml') else name}"
    request = Request(
        tuple(track or ()),
        tuple(method or ()),
        tuple(submission or ()),
        tuple(real or ()),
        fresh,
        workers,
        variant,
    )
    made = []
    try:
        folder = create_folder(root, name)
        with ExitStack() as shown:
            on_limits = partial(late_bars(shown, ("limits",)), "limits")
            for one in run_suite(folder, request, print_line, on_limits):
                made.append(one)
                print_line(f"{one.key}: {one.frames} frames, digest {one.digest}")
    except KeyboardInterrupt:
        console.print("interrupted; run the same command again to continue")
        raise
    records = [one._asdict() | {"root": str(one.root)} for one in made]
    sentence = f"{len(made)} datasets in {root}; next: vbaa-bench suite leaderboard {root}"
    print_result({"folder": str(root), "datasets": records}, sentence, as_json)
    if failed := sum(one.failed_frames for one in made):
        console.print(f"{failed} frames failed; truth/shard_*/failures.json states the reasons")
        raise typer.Exit(1)


@suite.command(cls=Command, epilog="Example: vbaa-bench suite verify runs/suite_1.0")
def verify(
    folder: SuiteFolderPath,
    track: Tracks = None,
    freeze: Annotated[
        bool,
        typer.Option("--freeze", help="freeze them instead, in the file beside the suite"),
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Compare datasets with the frozen frames of their suite.

    The exit status is 1 if a dataset is missing or damaged, or is not that of the suite.
    """
    with importing():
        from vbaa_bench.suite.folder import open_folder
        from vbaa_bench.suite.frozen import freeze as freeze_frames
        from vbaa_bench.suite.frozen import verify_suite

    opened = open_folder(folder)
    if freeze:
        if not track:
            raise InputError("--freeze needs --track: frames are frozen track by track")
        added = freeze_frames(opened, tuple(track))
        sentence = f"{len(added)} datasets added to {opened.suite.frozen}"
        print_result({"frozen": added, "file": str(opened.suite.frozen)}, sentence, as_json)
        return
    verdicts = []
    for one in verify_suite(opened, tuple(track or ()), print_line):
        verdicts.append(one)
        if not as_json:
            print_result({}, f"{one.key}: {one.sentence}", False)
    if as_json:
        print_result({"datasets": [one._asdict() for one in verdicts]}, "", True)
    if not all(one.holds for one in verdicts):
        raise typer.Exit(1)


@suite.command(cls=Command, epilog="Example: vbaa-bench suite check my_submission")
def check(
    submission: Annotated[
        Path, typer.Argument(callback=checked_path, help="folder with method.yaml")
    ],
    as_json: AsJson = False,
) -> None:
    """Name everything that is missing or wrong in a submission, in one pass.

    The exit status is 1 if anything is.
    """
    with importing():
        from vbaa_bench.suite.submission import check_submission, read_submission

    with console.status("checking"):
        findings = check_submission(submission)
    wrong = [finding for finding in findings if finding.wrong]
    lines = [f"{'wrong' if one.wrong else 'note ':5}  {one.sentence}" for one in findings]
    if wrong:
        lines.append(f"{submission}: {len(wrong)} mistakes")
    elif read_submission(submission).code is None:
        lines.append(f"{submission}: can be sent")
    else:
        lines.append(f"{submission}: can be sent; code was not run, check-method runs it")
    record = {"findings": [finding._asdict() for finding in findings]}
    print_result(record, "\n".join(lines), as_json)
    if wrong:
        raise typer.Exit(1)


@suite.command(cls=Command, epilog="Example: vbaa-bench suite leaderboard runs/suite_1.0")
def leaderboard(folder: SuiteFolderPath, as_json: AsJson = False) -> None:
    """Rank all methods and submissions by track; write one HTML page and CSV tables.

    A rank is one more than the number of methods that are better by a paired bootstrap, so that
    several can have rank 1. On real sets, methods are compared with balance and ruler, not ranked.
    """
    with importing():
        from vbaa_bench.report.numbers import short
        from vbaa_bench.suite.figures import ERROR, FIGURES
        from vbaa_bench.suite.folder import open_folder
        from vbaa_bench.suite.leaderboard import leaderboard as rank
        from vbaa_bench.suite.page import QUANTITIES, value_text, write_leaderboard
        from vbaa_bench.suite.real import scored_sets

    opened = open_folder(folder)
    with console.status("resampling"):
        tables, sets = rank(opened), scored_sets(opened)
        page = write_leaderboard(opened, tables, sets)
    if not as_json:
        for table in tables:
            rows = [
                (
                    place.method,
                    "–" if place.rank is None else str(place.rank),
                    value_text(place.figures[ERROR]),
                )
                for place in table.places
            ]
            show_table(
                f"{table.name}: {table.sentence()}",
                ("method", "rank", FIGURES[ERROR].heading),
                rows,
            )
        for one in sets:
            show_table(
                f"real set {one.name}",
                ("method", "load", "error of", "answered", "median", "known to", "RMS, sigmas"),
                [
                    (
                        method,
                        score.load,
                        QUANTITIES[score.quantity],
                        f"{short(score.answered_pct)} %",
                        short(score.error_pct),
                        short(score.known_pct),
                        short(score.rms_deviation),
                    )
                    for method, score in one.scores
                ],
            )
    record = {
        "page": str(page),
        "tracks": {table.name: table.sentence() for table in tables},
        "real": {
            one.name: [{"method": method, **score._asdict()} for method, score in one.scores]
            for one in sets
        },
    }
    print_result(record, f"page: {page}", as_json)
