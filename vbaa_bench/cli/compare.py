"""The command compare: with a baseline, the errors of an earlier run, which it also stores."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from solver.instrument.errors import InputError
from vbaa_bench.cli.interrupt import importing
from vbaa_bench.cli.options import AsJson, checked_path
from vbaa_bench.report.console import console, print_line, print_result, show_table

if TYPE_CHECKING:
    from vbaa_bench.regression.comparison import Change


def compare(
    run: Annotated[Path, typer.Argument(help="folder of a scored run, or of several")],
    baseline: Annotated[
        Path, typer.Argument(callback=checked_path, help="baseline file, or folder of several")
    ],
    everything: Annotated[
        bool, typer.Option("--all", help="also print what has not changed, and all strata")
    ] = False,
    strict: Annotated[
        bool, typer.Option("--strict", help="fail if a result of all frames is not distinguishable")
    ] = False,
    save: Annotated[
        bool, typer.Option("--save", help="store the errors of every frame as BASELINE instead")
    ] = False,
    why: Annotated[
        str | None,
        typer.Option(help="with --save: why an existing baseline is replaced; it is stored"),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Compare a scored run with its baseline; report what became better or worse.

    A folder of baselines is compared with the runs of the same names. The exit status is 1 if any
    result is worse, and 2 if nothing can be compared. Results that are not distinguishable do not
    fail, because some are in every comparison of few pushes or of other images; with --strict the
    exit status is 3 if one of all frames is, and none is worse.
    """
    if save:
        if everything or strict:
            raise InputError("--save compares nothing: --all and --strict are not allowed")
        _save(run, baseline, why, as_json)
        return
    if why is not None:
        raise InputError("--why is stated without --save")
    with importing():
        from vbaa_bench.api import comparison as api

    with console.status("comparing"):
        comparison = api.compare(run, baseline)
    worse = comparison.worse
    if as_json:
        record = {
            "worse": len(worse),
            "better": len(comparison.better),
            "not_distinguishable": len(comparison.not_distinguishable),
            "notes": list(comparison.notes),
            "changes": comparison.records(),
        }
        print_result(record, "", True)
    else:
        shown = comparison.changes if everything else comparison.reported
        if shown:
            show_table("changes", _HEADS, map(_cells, shown))
        for note in comparison.notes:
            print_line(note)
        print_result({}, comparison.sentence, False)
    if worse:
        raise typer.Exit(1)
    if strict and comparison.unresolved:
        raise typer.Exit(3)


def _save(run: Path, out: Path, why: str | None, as_json: bool) -> None:
    with importing():
        from vbaa_bench.api.comparison import save_baseline

    methods = save_baseline(run, out, why=why)
    record = {"baseline": str(out), "bytes": out.stat().st_size, "methods": methods}
    print_result(record, f"{out}: {len(methods)} methods", as_json)


_HEADS = (
    "scene",
    "method",
    "quantity",
    "stratum",
    "pushes",
    "old",
    "new",
    "smallest change",
    "p",
    "",
)


def _cells(change: "Change") -> tuple[str, ...]:
    unit = f", {change.unit}" if change.unit else ""
    smallest = "none" if change.smallest is None else f"{change.smallest:.2g}"
    return (
        change.scene,
        change.method,
        f"{change.quantity}{unit}",
        change.stratum,
        str(change.pushes),
        f"{change.old:.4g}",
        f"{change.new:.4g}",
        smallest,
        f"{change.p:.2g}",
        change.verdict,
    )
