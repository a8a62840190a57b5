"""Commands that check a method and this machine."""

import sys
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from solver.instrument.errors import InputError
from vbaa_bench.cli.interrupt import importing
from vbaa_bench.cli.options import MEMORY_GB, AsJson, Memory, Variant, checked_path
from vbaa_bench.report.console import console, print_result, show_table


def check_method(
    method: Annotated[str, typer.Argument(help="package.module:function, or a name of the solver")],
    dataset: Annotated[
        Path | None,
        typer.Argument(
            callback=checked_path,
            help="dataset folder, from generate or run",
            show_default="three pushes, rendered once",
        ),
    ] = None,
    stability: Annotated[
        bool,
        typer.Option(
            "--stability",
            help="measure noise amplification, rounding sensitivity and condition number instead, "
            "on simulated points; METHOD may be all",
        ),
    ] = False,
    memory: Memory = MEMORY_GB,
    variant: Variant = None,
    as_json: AsJson = False,
) -> None:
    """Run a method on a dozen frames; say what is missing or wrong before a long run.

    Units, frame of reference, values that are not finite, covariance, errors, time, memory, and
    whether a second run gives the same results. The exit status is 1 if something is wrong.
    """
    if stability:
        if dataset is not None:
            raise InputError("--stability needs no dataset: its points are simulated")
        _show_stability(method, as_json)
        return
    with importing():
        from vbaa_bench.benchmarks import check_method as checks
        from vbaa_bench.render.variant import choose
        from vbaa_bench.workers.resources import cores

    root = dataset
    if root is None:
        with console.status("rendering three pushes into runs/check_method"):
            root = checks.built_in_dataset(Path("runs/check_method"), choose(variant), cores())
    with console.status(f"solving {checks.FRAMES} frames twice"):
        findings = checks.check_method(method, root, memory)
    record = {"findings": [finding._asdict() for finding in findings]}
    lines = [f"{finding.status:5}  {finding.sentence}" for finding in findings]
    print_result(record, "\n".join(lines), as_json)
    if any(finding.status == "wrong" for finding in findings):
        raise typer.Exit(1)


def _show_stability(method: str, as_json: bool) -> None:
    """Measure the stability of a method, or of all of the solver, and print it."""
    with importing():
        from solver.methods import METHODS
        from solver.methods.by_name import find_method
        from vbaa_bench.benchmarks import stability

    if ":" in method:  # a function of the user's own may be in the current folder
        sys.path.append(str(Path.cwd()))
    methods = METHODS if method == "all" else {method: find_method(method)}
    with console.status("perturbing points"):
        record = stability.measure(methods)
    if as_json:
        print_result(record, "", True)
        return
    distances = ", ".join(f"{contact:g}" for contact in stability.CONTACTS)
    show_table(
        f"error per pixel of noise, contacts at x_c / L = {distances}; condition; rounding",
        ("method", "deflection", "x_c, % of L", "force, %", "condition", "x_c / L by 1 ulp"),
        stability.rows(record),
    )


def doctor(
    install: Annotated[
        bool, typer.Option("--install", help="install missing libraries with apt, as root")
    ] = False,
    quiet: Annotated[bool, typer.Option("--quiet", help="print one line only")] = False,
    as_json: AsJson = False,
) -> None:
    """Report which renderer variants work on this machine, and what to install."""
    # Import nothing that needs the renderer's libraries: this command must run without them.
    with importing():
        from vbaa_bench.cli import doctor as checks

    if install:
        console.print(checks.install_libraries())
        if quiet:
            return
    diagnosis = checks.diagnose()
    table = Table("variant", "works", "message")
    for probe in diagnosis.probes:
        table.add_row(probe.variant, "yes" if probe.works else "no", probe.message)
    if as_json:
        print_result(diagnosis.record(), "", True)
    else:
        if not quiet:
            Console().print(table)
        console.print(diagnosis.advice)
    if not diagnosis.healthy:
        raise typer.Exit(1)
