"""Commands that check limits, a method, a dataset and this machine."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from vbaa_bench.cli.interrupt import importing
from vbaa_bench.cli.options import MEMORY_GB, AsJson, DatasetPath, Memory, Variant
from vbaa_bench.report.console import console, print_result, progress_bars, show_table


def check_limits(
    scenes: Annotated[list[Path], typer.Argument(help="scene files")],
    frames: Annotated[int, typer.Option(min=1, help="frames per scene")] = 3,
    exposures: Annotated[
        int, typer.Option(min=100, help="noisy exposures of the first frame of each scene")
    ] = 2000,
    out: Annotated[Path | None, typer.Option(help="Markdown file to write")] = None,
    variant: Variant = None,
    as_json: AsJson = False,
) -> None:
    """Compare information limits with those of re-rendered images, and with noisy exposures."""
    with importing():
        from solver.lab.writing import prepare_output_path, write
        from vbaa_bench.benchmarks import limit_agreement, limit_page, limit_trials
        from vbaa_bench.render.variant import choose

    if out:
        prepare_output_path(out)
    with progress_bars() as progress:
        task = progress.add_task("rendering", total=frames * len(scenes))
        record = limit_page.measure(
            scenes, choose(variant), frames, exposures, lambda: progress.advance(task)
        )
    if out:
        counts = f"--frames {frames} --exposures {exposures} --out {out}"
        command = f"vbaa-bench check-limits {' '.join(map(str, scenes))} {counts}"
        write(out, limit_page.markdown(record, command).encode())
    if as_json:
        print_result(record, "", True)
        return
    show_table(
        "ratios of standard deviations",
        limit_agreement.HEADS,
        limit_agreement.lines(record["agreement"]),
    )
    show_table("noisy exposures", limit_trials.HEADS, limit_trials.lines(record["trials"]))


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
        from vbaa_bench.generation.workers import cores
        from vbaa_bench.render.variant import choose

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


def check_learning(
    datasets: Annotated[list[Path], typer.Argument(help="datasets or collections of rigs")],
    pushes: Annotated[int, typer.Option(min=2, help="pushes to learn from, without splits")] = 5,
    draws: Annotated[int, typer.Option(min=1, help="times that they are drawn")] = 4,
    force_sigma_pct: Annotated[
        float | None,
        typer.Option(min=0, max=100, help="sigma of one known force", show_default="none is known"),
    ] = None,
    object_radius_mm: Annotated[
        float | None,
        typer.Option(min=0, help="radius of the touched objects", show_default="unknown"),
    ] = None,
    weights: Annotated[
        Path | None,
        typer.Option(
            help="dataset of hung weights on the same rig, one of which is the known force",
            show_default="a contact is known",
        ),
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="seed of the draws")] = 1,
    out: Annotated[Path | None, typer.Option(help="Markdown file to write")] = None,
    as_json: AsJson = False,
) -> None:
    """Compare the exact fit with the beam as stated, and as learned from other pushes."""
    with importing():
        from solver.lab.writing import prepare_output_path, write
        from vbaa_bench.benchmarks import learning
        from vbaa_bench.benchmarks.learning_table import HEADS, markdown

    if out:
        prepare_output_path(out)
    with progress_bars() as bars:
        task = bars.add_task("datasets", total=learning.count_datasets(datasets))
        results = learning.measure(
            datasets,
            pushes,
            draws,
            seed,
            force_sigma_pct,
            object_radius_mm,
            weights,
            lambda: bars.advance(task),
        )
    if out:
        options = f"--pushes {pushes} --draws {draws} --seed {seed}"
        if force_sigma_pct is not None:
            options += f" --force-sigma-pct {force_sigma_pct:g}"
        if object_radius_mm is not None:
            options += f" --object-radius-mm {object_radius_mm:g}"
        if weights is not None:
            options += f" --weights {weights}"
        command = f"vbaa-bench check-learning {' '.join(map(str, datasets))} {options} --out {out}"
        write(out, markdown(results, command).encode())
    if as_json:
        print_result({"results": [one.record() for one in results]}, "", True)
        return
    show_table("the exact fit", HEADS, [one.line() for one in results])


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
