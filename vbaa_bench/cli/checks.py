"""Commands that check limits, a method, a dataset and this machine."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from vbaa_bench.cli.interrupt import importing
from vbaa_bench.cli.options import MEMORY_GB, AsJson, DatasetPath, Memory, Variant
from vbaa_bench.report.console import console, print_result, show_table


def check_method(
    method: Annotated[str, typer.Argument(help="package.module:function, or a name of the solver")],
    dataset: Annotated[
        Path | None,
        typer.Argument(
            help="dataset folder, from generate or run", show_default="three pushes, rendered once"
        ),
    ] = None,
    memory: Memory = MEMORY_GB,
    variant: Variant = None,
    as_json: AsJson = False,
) -> None:
    """Run a method on a dozen frames; say what is missing or wrong before a long run.

    Units, frame of reference, values that are not finite, covariance, errors, time, memory, and
    whether a second run gives the same results. The exit status is 1 if something is wrong.
    """
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


def leaks(dataset: DatasetPath, as_json: AsJson = False) -> None:
    """Test whether order, names, image files or the encoder of a dataset predict the contact.

    DATASET may be a collection. The exit status is 1 if a feature is better than chance; by chance,
    one clean feature in a hundred is.
    """
    with importing():
        from vbaa_bench.benchmarks.leaks import find_leaks

    with console.status("searching for leaks"):
        tests = find_leaks(dataset)
    if as_json:
        print_result({"features": [test.record() for test in tests]}, "", True)
    else:
        show_table(
            "held-out R^2 of x_c over beam length",
            ("feature", "frames", "R^2", "99 % of permutations", "passes"),
            [
                (
                    test.feature,
                    str(test.frames),
                    f"{test.r_squared:.4f}",
                    f"{test.chance:.4f}",
                    "yes" if test.passes else "no",
                )
                for test in tests
            ],
        )
    if not all(test.passes for test in tests):
        raise typer.Exit(1)


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
        table.add_row(probe.variant, "yes" if probe.works else "no", probe.said)
    if as_json:
        print_result(diagnosis.record(), "", True)
    else:
        if not quiet:
            Console().print(table)
        console.print(diagnosis.advice)
    if not diagnosis.healthy:
        raise typer.Exit(1)
